// SPDX-License-Identifier: Apache-2.0

// The one interface to what measures where probe and needle are: a device, a recording, a script,
// the mouse. Time is injected: seconds on the session's clock.
#pragma once

#include <cstdint>
#include <functional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "formats/base/mailbox.h"
#include "formats/base/message.h"
#include "formats/recording/session.h"
#include "runtime/engine/tracker_reading.h"

namespace sonocase::runtime::inline tracking {

// Which transform of a stream or recording is which tool: role (probe, needle, reference) and name.
using ToolNames = std::vector<std::pair<std::string, std::string>>;

enum class TrackerPhase : std::uint8_t {
    searching,  // no device yet
    starting,   // found and being set up
    streaming,
    ended,   // a recording or a script that is over
    failed,  // needs the user; `message` says what to do
};

struct TrackerHealth {
    TrackerPhase phase = TrackerPhase::searching;
    Message device;      // "Polhemus Viper", with its serial where it has one
    Message message;     // a whole sentence for the user; empty when all is well
    double rate_hz = 0;  // measured
    // From what the device measures to the reading, over which poses are predicted; negative: not
    // known, and not predicted.
    double late_s = -1;
    std::uint64_t readings = 0;
    std::uint64_t bad_frames = 0;  // discarded: wrong checksum or length, not a number
    std::uint64_t connects = 0;
    // # sensors: their names where the tracker knows them, as it heard them; empty: it does not, or
    // the sensor is free.
    std::vector<std::string> sensors;
};

class Tracker {
  public:
    virtual ~Tracker() = default;
    // Writes the newest reading and returns true, or returns false if none is newer than the last
    // one. Never blocks and allocates nothing; for the frame loop.
    virtual bool poll(double now_s, TrackerReading& reading) = 0;
    virtual TrackerHealth health() const = 0;
    // Sets what the tracker's own thread calls as soon as poll() has something new; {} ends that.
    // A tracker that is a function of time has no thread and ignores it.
    virtual void set_wake(std::function<void()>) {}
    // Gives roles to names from now on. What knows no names ignores it.
    virtual void set_tools(const ToolNames&) {}
    // Length of a recording or script; negative: without end.
    virtual double duration_s() const { return -1; }
    // Number of readings of a recording; 0: not a recording.
    virtual int recorded_readings() const { return 0; }
    // Time of recorded reading i, from 0 at the first.
    virtual double recorded_time_s(int) const { return 0; }
    // When the next reading of a recording is due after a poll, on the session's clock; negative:
    // not known.
    virtual double next_s() const { return -1; }
    // Where the last reading `restarts`: what a recording with acts holds before it, from its
    // beginning, so that a jump leads to the same state as playing. Valid until the next poll.
    virtual std::span<const SessionSample> passed_over() const { return {}; }
    // The next poll need not go on from the last: somebody has moved the time line.
    virtual void expect_jump() {}
    // True for hardware and networks. Their readings are noisy, so that a pose that stays equal to
    // the last bit means a frozen sensor.
    virtual bool is_device() const { return false; }
};

// A clock for trackers with a thread of their own: seconds on the session's clock.
using SessionClock = std::function<double()>;

const char* phase_name(TrackerPhase phase);

// A tracker whose readings come from its owner: the window's mouse, a browser, a test. One thread
// pushes and one polls.
class PushTracker final : public Tracker {
  public:
    explicit PushTracker(std::string device, bool is_device = false)
        : device_(std::move(device)), is_device_(is_device) {}
    void push(const TrackerReading& reading) {
        box_.publish(reading);
        if (wake_) wake_();
    }
    bool poll(double, TrackerReading& reading) override {
        if (!box_.refresh()) return false;
        reading = box_.value();
        return true;
    }
    TrackerHealth health() const override {
        TrackerHealth health;
        health.phase = TrackerPhase::streaming;
        health.device = device_;
        return health;
    }
    void set_wake(std::function<void()> wake) override { wake_ = std::move(wake); }
    bool is_device() const override { return is_device_; }

  private:
    std::string device_;
    bool is_device_;
    Mailbox<TrackerReading> box_;
    std::function<void()> wake_;
};

}  // namespace sonocase::runtime::inline tracking
