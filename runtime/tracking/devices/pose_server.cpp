// SPDX-License-Identifier: Apache-2.0

#include "runtime/tracking/devices/pose_server.h"

#include <sys/random.h>

#include <algorithm>
#include <array>
#include <cstdio>
#include <utility>
#include <vector>

#include "formats/recording/sequence.h"
#include "runtime/tracking/devices/websocket.h"

namespace sonocase::runtime::inline tracking_devices {
namespace {

constexpr std::size_t kMaxPoseClients = 16;
constexpr int kRequestTurns = 2000;  // of the server's loop: a few seconds to ask properly

Result<std::string> random_token() {
    std::array<std::uint8_t, 16> bytes;
    if (::getrandom(bytes.data(), bytes.size(), 0) != static_cast<ssize_t>(bytes.size()))
        return Error{"no random numbers for the token", "--serve-poses", "try again"};
    std::string token;
    for (const std::uint8_t byte : bytes) {
        token += "0123456789abcdef"[byte >> 4];
        token += "0123456789abcdef"[byte & 15];
    }
    return token;
}

std::string rows_of(const Rigid& pose) {
    std::string out = "[";
    for (const double value : matrix_from_rigid(pose)) {
        std::array<char, 32> text;
        std::snprintf(text.data(), text.size(), out.size() > 1 ? ",%.17g" : "%.17g", value);
        out += text.data();
    }
    return out + "]";
}

}  // namespace

std::string text_of(const ServedPoses& poses) {
    std::array<char, 64> time;
    std::snprintf(time.data(), time.size(), "{\"time_s\":%.6f,\"probe\":", poses.time_s);
    return time.data() + rows_of(poses.mannequin_from_probe) + ",\"needle\":" +
           (poses.has_needle ? rows_of(poses.mannequin_from_needle) : std::string("null")) + "}";
}

struct PoseServer::Client {
    Socket socket;
    std::string request = {};
    websocket::ClientFrames frames = {};
    std::vector<std::uint8_t> unsent = {};
    std::size_t at = 0;
    int turns = 0;
    bool accepted = false, ends = false;  // ends: once what is unsent has been sent
    bool has_pose = false;
};

Result<std::unique_ptr<PoseServer>> PoseServer::start(const std::string& address_and_port,
                                                      const std::string& token) {
    std::string host = "127.0.0.1";
    int port = 0;
    if (!split_address(address_and_port, host, port)) {
        return Error{"not an address: " + address_and_port, "--serve-poses",
                     "use PORT or ADDRESS:PORT, e.g. 18946"};
    }
    SONOCASE_TRY(Socket listener, Socket::listen(host, port));
    SONOCASE_TRY(std::string secret, token.empty() ? random_token() : Result<std::string>(token));
    return std::unique_ptr<PoseServer>(
        new PoseServer(std::move(listener), host, std::move(secret)));
}

PoseServer::PoseServer(Socket listener, const std::string& host, std::string token)
    : listener_(std::move(listener)), token_(std::move(token)) {
    const bool in_brackets = host.find(':') != host.npos && host.front() != '[';  // IPv6
    url_ = "ws://" + (in_brackets ? "[" + host + "]" : host) + ":" +
           std::to_string(listener_.port()) + "/?token=" + token_;
    thread_ = std::thread([this] { run(); });
}

PoseServer::~PoseServer() {
    stop_ = true;
    thread_.join();
}

// fresh: the frame of a new pose; empty: none came. last: the frame of the newest pose.
void PoseServer::serve(Client& client, const std::string& fresh, const std::string& last) {
    std::array<std::uint8_t, 4096> buffer;
    const auto send = [&](std::string_view text) {
        client.unsent.insert(client.unsent.end(), text.begin(), text.end());
    };
    const long heard = client.socket.read(buffer, 0);
    if (heard < 0) {
        client.socket.close();
        return;
    }
    const std::span<const std::uint8_t> bytes(buffer.data(), static_cast<std::size_t>(heard));
    if (client.at == client.unsent.size()) {
        client.unsent.clear();
        client.at = 0;
    }
    if (!client.accepted && !client.ends) {
        client.request.append(bytes.begin(), bytes.end());
        if (const auto answer = websocket::answer_of(client.request, token_)) {
            send(answer->text);
            client.accepted = answer->accepted;
            client.ends = !answer->accepted;
        } else if (++client.turns > kRequestTurns) {
            client.socket.close();
            return;
        }
    } else if (client.accepted && !client.ends && heard > 0) {
        client.ends = !client.frames.take(bytes, client.unsent);
    }
    // A page that has not taken the previous pose yet gets the newest one later.
    if (client.accepted && !client.ends && client.unsent.empty()) {
        send(client.has_pose ? fresh : last);
        client.has_pose = !last.empty();
    }
    if (client.at < client.unsent.size()) {
        const long sent = client.socket.write(std::span(client.unsent).subspan(client.at));
        if (sent < 0) client.socket.close();
        if (sent > 0) client.at += static_cast<std::size_t>(sent);
    }
    if (client.ends && client.at == client.unsent.size()) client.socket.close();
}

void PoseServer::run() {
    std::vector<Client> clients;
    std::string last;
    while (!stop_) {
        // Those who connect without end do not hold up those who are there.
        std::size_t accepted = 0;
        for (Socket client = listener_.accept(clients.empty() ? 0.05 : 0.002); client.open();
             client = ++accepted < kMaxPoseClients ? listener_.accept(0) : Socket()) {
            if (clients.size() < kMaxPoseClients) clients.push_back({std::move(client)});
        }
        std::string fresh;
        if (box_.refresh() && box_.value().has_probe) {
            const std::vector<std::uint8_t> frame = websocket::text_frame(text_of(box_.value()));
            fresh.assign(frame.begin(), frame.end());
            last = fresh;
        }
        for (Client& client : clients) serve(client, fresh, last);
        std::erase_if(clients, [](const Client& client) { return !client.socket.open(); });
        clients_ = static_cast<int>(std::count_if(clients.begin(), clients.end(),
                                                  [](const Client& c) { return c.accepted; }));
    }
}

}  // namespace sonocase::runtime::inline tracking_devices
