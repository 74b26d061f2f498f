// SPDX-License-Identifier: Apache-2.0

// Sends probe and needle to pages (docs/browser.md) over a WebSocket, so that this machine's
// tracker moves the probe of a page. One text per pose:
//
//     {"time_s": t, "probe": [16 numbers, mannequin_from_probe row by row], "needle": [16] or null}
//
// Only pages that know the token are served. The frame loop hands a pose over and never waits. A
// slow page misses poses and does not delay the others.
#pragma once

#include <atomic>
#include <memory>
#include <string>
#include <thread>

#include "formats/base/geometry.h"
#include "formats/base/mailbox.h"
#include "formats/base/result.h"
#include "runtime/tracking/devices/socket.h"

namespace sonocase::runtime::inline tracking_devices {

struct ServedPoses {
    double time_s = 0;
    bool has_probe = false, has_needle = false;
    Rigid mannequin_from_probe, mannequin_from_needle;
};

std::string text_of(const ServedPoses& poses);  // has_probe must be true

class PoseServer {
  public:
    // "[ADDRESS:]PORT"; loopback unless an address is given; port 0 takes a free one. token: "" for
    // a new random one.
    static Result<std::unique_ptr<PoseServer>> start(const std::string& address_and_port,
                                                     const std::string& token = "");
    ~PoseServer();
    PoseServer(const PoseServer&) = delete;
    PoseServer& operator=(const PoseServer&) = delete;

    // "ws://127.0.0.1:18946/?token=...", for the page's address: ?poses=...
    const std::string& url() const { return url_; }
    int port() const { return listener_.port(); }
    int clients() const { return clients_.load(); }
    // From the frame loop: fill slot(), then publish(). Allocates nothing.
    ServedPoses& slot() { return box_.slot(); }
    void publish() { box_.publish(); }

  private:
    struct Client;
    PoseServer(Socket listener, const std::string& host, std::string token);
    void run();
    void serve(Client& client, const std::string& fresh, const std::string& last);

    Socket listener_;
    std::string token_, url_;
    Mailbox<ServedPoses> box_;
    std::atomic<bool> stop_{false};
    std::atomic<int> clients_{0};
    std::thread thread_;
};

}  // namespace sonocase::runtime::inline tracking_devices
