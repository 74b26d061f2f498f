// SPDX-License-Identifier: Apache-2.0

// Poses over OpenIGTLink: from a server such as PLUS, to which it connects, or from a program that
// connects to it (listening).
#pragma once

#include <array>
#include <atomic>
#include <functional>
#include <memory>
#include <mutex>
#include <string>
#include <thread>

#include "formats/base/mailbox.h"
#include "formats/base/result.h"
#include "runtime/tracking/devices/igtl_message.h"
#include "runtime/tracking/devices/make_tracker.h"
#include "runtime/tracking/devices/socket.h"
#include "runtime/tracking/tracker.h"

namespace sonocase::runtime::inline tracking_devices {

struct IgtlTrackerOptions {
    std::string host = "127.0.0.1";
    int port = 18944;
    bool listening = false;
    double retry_s = 0.5;
    double silence_s = 5;  // a connection on which no byte came for so long is opened again
    double ask_s = 0.5;    // silent for so long, the sender is asked for TDATA
    // After so long without a pose of the probe, health() says what came instead.
    double explain_s = 1.5;
    ToolNames tools;  // which transform is which tool; empty: by its name
};

// A device's name says which tool it is, as in recordings (formats/recording/tool_frames.h); others
// take the next free sensors in order. The pose of a name that ends in ToMannequin is that of the
// tool in `mannequin`. A transform for the role `reference` is the sensor kReferenceSensor. A
// SENSOR message of device ProbeForce gives the newtons on the probe's face, which come with the
// next pose.
//
// A listening tracker hears one program at a time: a second one is refused while the first sends,
// and health() says so.
//
// A sender that floods is read with at most a tenth of a core, and wakes the picture at most 500
// times a second; what it sends is kept in at most 2 MB and 16 names.
//
// Each sensor keeps the time of its own last pose. One whose sender calls it invalid, or sends no
// numbers for it, is lost.
class IgtlTracker final : public Tracker {
  public:
    static Result<std::unique_ptr<Tracker>> start(const IgtlTrackerOptions& options,
                                                  SessionClock clock);
    ~IgtlTracker() override;
    bool poll(double now_s, TrackerReading& reading) override;
    TrackerHealth health() const override;
    void set_wake(std::function<void()> wake) override;
    void set_tools(const ToolNames& tools) override;
    bool is_device() const override { return true; }
    int port() const { return listener_.open() ? listener_.port() : options_.port; }

  private:
    IgtlTracker(const IgtlTrackerOptions& options, SessionClock clock, Socket listener);
    void run();
    // Returns the program that waits for this one's end, if there is one.
    Socket converse(Socket socket);
    void pay();
    void wake(double now_s);
    void forget_sensors();
    void take_tools();
    void take(const std::vector<igtl::NamedPose>& poses, double device_time_s);
    int sensor_of(const std::string& name);
    int take_place(int sensor, const std::string& name);
    int known_sensor(const std::string& name) const;  // -1: none yet
    bool plays(const std::string& role, const std::string& name) const;
    bool relative_to_reference() const;
    bool ends_in_reference(const std::string& name) const;
    void note(const igtl::NamedPose& pose);
    void note_probe(const igtl::NamedPose& pose, double now_s);
    void explain(double now_s);
    Message what_came(double now_s) const;
    void set_health(TrackerPhase phase, const Message& message);

    // What came on this connection, for the sentence that says why there is no pose.
    struct Heard {
        double since_s = 0, explained_s = 0, asked_s = 0;
        std::uint64_t wrong_checksum = 0, scaled = 0, mirrored = 0, not_finite = 0, others = 0,
                      lost = 0, unturned = 0, wrong_length = 0;
        std::string scaled_name, mirrored_name, lost_name, unturned_name, other_type, wrong_type;
        std::array<std::uint64_t, kMaxSensors> poses{};
        double farthest_mm = 0;  // place of the probe
        double probe_s = -1;     // when the probe's last pose came
        int slow = 0;  // poses of the probe on end that came 0.2 s and more after the last
        double slow_hz = 0;
        double refused_s = -1;  // when a second program was turned away
    };

    IgtlTrackerOptions options_;
    SessionClock clock_;
    Socket listener_;
    std::atomic<bool> stop_{false};
    Mailbox<TrackerReading> box_;
    TrackerReading reading_;
    std::vector<std::string> names_;  // # sensors; empty: the sensor is free
    Heard heard_;
    mutable std::mutex mutex_;
    TrackerHealth health_;
    ToolNames wanted_tools_;
    bool tools_changed_ = false;
    std::function<void()> wake_;
    double last_s_ = -1, mean_period_s_ = 0;
    bool to_wake_ = false;
    double woken_s_ = -1;
    double credit_s_ = 0, paid_s_ = -1, spent_before_s_ = 0;  // see pay()
    std::thread thread_;
};

}  // namespace sonocase::runtime::inline tracking_devices
