// SPDX-License-Identifier: Apache-2.0

#include "runtime/tracking/devices/igtl_server.h"

#include <algorithm>
#include <array>
#include <chrono>
#include <utility>

#include "runtime/tracking/devices/igtl_message.h"

namespace sonocase::runtime::inline tracking_devices {
namespace {

constexpr std::size_t kMaxClients = 16;

std::vector<std::uint8_t> messages_of(const ServedFrame& frame) {
    std::vector<std::uint8_t> out;
    const auto add = [&](const std::vector<std::uint8_t>& message) {
        out.insert(out.end(), message.begin(), message.end());
    };
    if (frame.has_probe) {
        add(igtl::encode_transform("ProbeToMannequin", frame.unix_time_s,
                                   frame.mannequin_from_probe));
    }
    if (frame.has_probe) {
        const std::array<double, 2> force{frame.force_n, frame.pressure_kpa};
        add(igtl::encode_sensor("ProbeForce", frame.unix_time_s, force));
    }
    if (frame.has_needle) {
        add(igtl::encode_transform("NeedleToMannequin", frame.unix_time_s,
                                   frame.mannequin_from_needle));
    }
    // While a picture's size changes its pixels may not fit; nobody could unpack such a message.
    const auto pixels = static_cast<std::size_t>(frame.width_px) * frame.height_px;
    if (frame.width_px > 0 && frame.height_px > 0 && frame.pixels.size() == pixels) {
        // The picture's x is the probe's x and its y the probe's z; the message places the middle
        // of the picture.
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
    SONOCASE_TRY(Socket listener, Socket::listen(address, port));
    return std::unique_ptr<IgtlServer>(new IgtlServer(std::move(listener)));
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
    std::vector<Client> clients;
    std::array<std::uint8_t, 4096> ignored;
    bool published = false;
    while (!stop_) {
        // Those who connect without end do not hold up those who are there.
        std::size_t accepted = 0;
        for (Socket client = listener_.accept(clients.empty() ? 0.05 : 0.002); client.open();
             client = ++accepted < kMaxClients ? listener_.accept(0) : Socket()) {
            if (clients.size() >= kMaxClients) continue;
            clients.push_back({std::move(client), {}, 0});
            // It gets the frame that is shown now: the next one may come much later.
            if (published) clients.back().unsent = messages_of(box_.value());
        }
        const bool fresh = box_.refresh();
        published = published || fresh;
        if (fresh && !clients.empty()) {
            const std::vector<std::uint8_t> messages = messages_of(box_.value());
            for (Client& client : clients) {
                // Whole messages only: one that has begun is finished before a newer one is taken.
                if (client.at < client.unsent.size()) continue;
                client.unsent = messages;
                client.at = 0;
            }
        }
        for (Client& client : clients) {
            // What a client sends (requests, status) is not needed and not kept.
            const long heard = client.socket.read(ignored, 0);
            long sent = 0;
            if (heard >= 0 && client.at < client.unsent.size()) {
                sent = client.socket.write(std::span(client.unsent).subspan(client.at));
                if (sent > 0) client.at += static_cast<std::size_t>(sent);
            }
            if (heard < 0 || sent < 0) client.socket.close();
        }
        std::erase_if(clients, [](const Client& client) { return !client.socket.open(); });
        clients_ = static_cast<int>(clients.size());
    }
}

}  // namespace sonocase::runtime::inline tracking_devices
