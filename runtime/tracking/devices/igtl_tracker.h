// SPDX-License-Identifier: Apache-2.0

// Poses over OpenIGTLink: from a server such as PLUS, to which it connects, or from a program that
// connects to it (listening).
#pragma once

#include <atomic>
#include <functional>
#include <memory>
#include <mutex>
#include <string>
#include <thread>

#include "formats/base/mailbox.h"
#include "formats/base/result.h"
#include "runtime/tracking/devices/igtl_message.h"
#include "runtime/tracking/devices/socket.h"
#include "runtime/tracking/tracker.h"

namespace sonocase::runtime::inline tracking_devices {

struct IgtlTrackerOptions {
    std::string host = "127.0.0.1";
    int port = 18944;
    bool listening = false;
    double retry_s = 0.5;
    double silence_s = 5;  // a connection on which no byte came for so long is opened again
};

// A device's name says which tool it is: one that begins with Probe, Transducer or Image is the
// probe, one that begins with Needle or Stylus the needle; others take the next free sensors in
// order. The pose of a name that ends in ToMannequin is that of the tool in `mannequin`. A SENSOR
// message of device ProbeForce gives the newtons on the probe's face, which come with the next
// pose.
class IgtlTracker final : public Tracker {
  public:
    static Result<std::unique_ptr<Tracker>> start(const IgtlTrackerOptions& options,
                                                  SessionClock clock);
    ~IgtlTracker() override;
    bool poll(double now_s, TrackerReading& reading) override;
    TrackerHealth health() const override;
    void set_wake(std::function<void()> wake) override;
    bool is_device() const override { return true; }
    int port() const { return listener_.open() ? listener_.port() : options_.port; }

  private:
    IgtlTracker(const IgtlTrackerOptions& options, SessionClock clock, Socket listener);
    void run();
    void converse(Socket socket);
    void take(const std::vector<igtl::NamedPose>& poses, double device_time_s);
    int sensor_of(const std::string& name);
    void set_health(TrackerPhase phase, const Message& message);

    IgtlTrackerOptions options_;
    SessionClock clock_;
    Socket listener_;
    std::atomic<bool> stop_{false};
    Mailbox<TrackerReading> box_;
    TrackerReading reading_;
    std::vector<std::string> names_;  // # sensors; empty: the sensor is free
    mutable std::mutex mutex_;
    TrackerHealth health_;
    std::function<void()> wake_;
    double last_s_ = -1, mean_period_s_ = 0;
    std::thread thread_;
};

}  // namespace sonocase::runtime::inline tracking_devices
