// SPDX-License-Identifier: Apache-2.0

#include "runtime/tracking/igtl/igtl_server.h"

#include <algorithm>
#include <array>
#include <chrono>
#include <utility>

#include "runtime/tracking/igtl/igtl_message.h"

namespace sonocase::runtime {
namespace {

constexpr std::size_t kMostGuests = 16;

std::vector<std::uint8_t> messages_of(const ServedFrame& frame) {
    std::vector<std::uint8_t> out;
    const auto add = [&](const std::vector<std::uint8_t>& message) {
        out.insert(out.end(), message.begin(), message.end());
    };
    if (frame.has_probe) {
        add(igtl::encode_transform("ProbeToMannequin", frame.unix_time_s,
                                   frame.mannequin_from_probe));
    }
    if (frame.has_needle) {
        add(igtl::encode_transform("NeedleToMannequin", frame.unix_time_s,
                                   frame.mannequin_from_needle));
    }
    if (frame.width_px > 0) {
        // Picture x is the probe's x, picture y its z; the message places the picture's middle.
        const Matrix3 probe_from_image = Matrix3::from_columns({1, 0, 0}, {0, 0, 1}, {0, -1, 0});
        const Point3 middle =
            frame.mannequin_from_probe *
            Point3{frame.mm_per_px * (0.5 * frame.width_px - frame.origin_x_px), 0,
                   frame.mm_per_px * (0.5 * frame.height_px - frame.origin_y_px)};
        const Rigid place{frame.mannequin_from_probe.rotation * probe_from_image,
                          {middle.x, middle.y, middle.z}};
        add(igtl::encode_image("Ultrasound", frame.unix_time_s, frame.width_px, frame.height_px,
                               frame.mm_per_px, place, frame.pixels));
    }
    return out;
}

}  // namespace

Result<std::unique_ptr<IgtlServer>> IgtlServer::start(const std::string& address, int port) {
    Result<Socket> listener = Socket::listen(address, port);
    if (!listener) return listener.error();
    return std::unique_ptr<IgtlServer>(new IgtlServer(std::move(*listener)));
}

Result<std::unique_ptr<IgtlServer>> IgtlServer::start(const std::string& address_and_port) {
    std::string host = "127.0.0.1";
    int port = 0;
    if (!split_address(address_and_port, host, port)) {
        return Error{"not an address: " + address_and_port, "--serve",
                     "use PORT or ADDRESS:PORT, e.g. 18945"};
    }
    return start(host, port);
}

IgtlServer::IgtlServer(Socket listener) : listener_(std::move(listener)) {
    thread_ = std::thread([this] { run(); });
}

IgtlServer::~IgtlServer() {
    stop_ = true;
    thread_.join();
}

void IgtlServer::run() {
    std::vector<Guest> guests;
    std::array<std::uint8_t, 4096> ignored;
    while (!stop_) {
        for (Socket newcomer = listener_.accept(guests.empty() ? 0.05 : 0.002); newcomer.open();
             newcomer = listener_.accept(0)) {
            if (guests.size() < kMostGuests) guests.push_back({std::move(newcomer), {}, 0});
        }
        if (box_.refresh() && !guests.empty()) {
            const std::vector<std::uint8_t> messages = messages_of(box_.value());
            for (Guest& guest : guests) {
                // Whole messages only: what has begun is finished before newer ones are taken.
                if (guest.at < guest.unsent.size()) continue;
                guest.unsent = messages;
                guest.at = 0;
            }
        }
        for (Guest& guest : guests) {
            // What a guest says (requests, status) is not needed and not kept.
            const long heard = guest.socket.read(ignored, 0);
            long sent = 0;
            if (heard >= 0 && guest.at < guest.unsent.size()) {
                sent = guest.socket.write(std::span(guest.unsent).subspan(guest.at));
                if (sent > 0) guest.at += static_cast<std::size_t>(sent);
            }
            if (heard < 0 || sent < 0) guest.socket.close();
        }
        std::erase_if(guests, [](const Guest& guest) { return !guest.socket.open(); });
        guests_ = static_cast<int>(guests.size());
    }
}

}  // namespace sonocase::runtime
