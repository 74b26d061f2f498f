// SPDX-License-Identifier: Apache-2.0

// Sends the picture and the tools to programs that connect (3D Slicer, PLUS), over OpenIGTLink:
//   IMAGE      Ultrasound            placed in `mannequin`
//   TRANSFORM  ProbeToMannequin, NeedleToMannequin
//   SENSOR     ProbeForce            newtons on the face, kPa over what touches
// The frame loop hands a frame over and never waits. A slow or silent client misses frames and does
// not delay the others.
#pragma once

#include <atomic>
#include <memory>
#include <mutex>
#include <thread>
#include <vector>

#include "formats/base/geometry.h"
#include "formats/base/mailbox.h"
#include "formats/base/result.h"
#include "runtime/tracking/devices/socket.h"

namespace sonocase::runtime::inline tracking_devices {

struct ServedFrame {
    double unix_time_s = 0;
    int width_px = 0, height_px = 0;
    double mm_per_px = 1;
    double origin_x_px = 0, origin_y_px = 0;  // pixel of the probe's origin
    Rigid mannequin_from_probe, mannequin_from_needle;
    bool has_probe = false, has_needle = false;
    double force_n = 0, pressure_kpa = 0;
    std::vector<std::uint8_t> pixels;
};

class IgtlServer {
  public:
    static Result<std::unique_ptr<IgtlServer>> start(const std::string& address, int port);
    ~IgtlServer();
    IgtlServer(const IgtlServer&) = delete;
    IgtlServer& operator=(const IgtlServer&) = delete;

    // "[ADDRESS:]PORT"; loopback unless an address is given.
    static Result<std::unique_ptr<IgtlServer>> start(const std::string& address_and_port);

    int port() const { return listener_.port(); }
    int clients() const { return clients_.load(); }
    // From the frame loop: fill slot(), then publish(). Allocates only when the picture grows.
    ServedFrame& slot() { return box_.slot(); }
    void publish() { box_.publish(); }

  private:
    struct Client {
        Socket socket;
        std::vector<std::uint8_t> unsent;
        std::size_t at = 0;
    };
    explicit IgtlServer(Socket listener);
    void run();

    Socket listener_;
    Mailbox<ServedFrame> box_;
    std::atomic<bool> stop_{false};
    std::atomic<int> clients_{0};
    std::thread thread_;
};

}  // namespace sonocase::runtime::inline tracking_devices
