// SPDX-License-Identifier: Apache-2.0

// Replays recorded poses of probe and needle at the times at which they were taken; and plays a
// recording or script at another speed.
#pragma once

#include <atomic>
#include <memory>
#include <string>
#include <vector>

#include "formats/base/result.h"
#include "formats/recording/poses.h"
#include "runtime/tracking/tracker.h"

namespace sonocase::runtime::inline tracking {

struct Recording {
    std::string name;          // shown as the device
    std::vector<Pose> probe;   // times increasing; at least one
    std::vector<Pose> needle;  // matched to the probe by time; may be empty
    bool in_mannequin = false;
    struct TimedActs {
        double time_s = 0;
        ActList acts;
    };
    std::vector<TimedActs> acts;  // of a procedure, in order of time
    // All samples, where there are acts: what a jump passes over. Empty: the recording cannot be
    // read as a session, and a jump then leaves the skipped acts out.
    std::vector<SessionSample> samples;
    Message note;  // what was left out, for the user; empty: nothing
};

class ReplayTracker final : public Tracker {
  public:
    ReplayTracker(Recording recording, bool loop);
    bool poll(double now_s, TrackerReading& reading) override;
    TrackerHealth health() const override;
    double duration_s() const override;
    int recorded_readings() const override { return static_cast<int>(recording_.probe.size()); }
    double recorded_time_s(int i) const override;
    double next_s() const override { return next_s_; }
    std::span<const SessionSample> passed_over() const override;

  private:
    Recording recording_;
    // Nearest in time; none within reach: # needle readings.
    std::vector<std::size_t> needle_of_probe_;
    bool loop_;
    bool started_ = false;
    double start_s_ = 0, next_s_ = -1;
    std::uint64_t laps_ = 0;
    std::size_t last_ = ~std::size_t{0};
    std::size_t acted_ = 0;   // acts that have been handed on
    std::size_t passed_ = 0;  // samples before the last reading, where it restarts; else 0
    std::uint64_t sequence_ = 0, not_ok_ = 0;
    bool over_ = false;
};

// Reads poses to replay: what load_recording_file() reads (formats/files/load_save.h). Readings
// whose time falls or is not a number are left out, and noted. needle_lag_s is taken from the
// needle's times unless they were recorded in the mannequin. The needle is lost where it has no
// reading near in time. Tools that end in different frames are brought to one; with a transform for
// the role `reference`, both are taken relative to it (formats/recording/tool_frames.h).
// Errors: no times (check_times()); places in metres; no pose that counts; no needle's reading at
// the time of any of the probe's, as of two clocks; frames that nothing connects.
Result<Recording> load_recording(const std::string& files,
                                 double needle_lag_s = 0,
                                 const ToolNames& tools = {});

// A recording or script at another speed, or from another place: for the tracker inside, time runs
// faster or slower, or jumps. Speed and place are set from any thread; one thread polls.
class PacedTracker final : public Tracker {
  public:
    // inner: a function of time with an end, such as a replay or a sweep.
    explicit PacedTracker(std::unique_ptr<Tracker> inner);

    void set_speed(double speed);  // in [0, 16]; 0 stands still
    double speed() const { return speed_.load(); }
    // Forward, or back where seconds < 0, with the next poll.
    void jump(double seconds) { jump_s_.fetch_add(seconds); }
    double at_s() const { return at_s_.load(); }  // in [0, duration_s()), at the last poll
    // true: from its end on it stands still; false, as at first: it starts over.
    void stand_at_end(bool stand) { stands_at_end_ = stand; }

    bool poll(double now_s, TrackerReading& reading) override;
    TrackerHealth health() const override { return inner_->health(); }
    void set_tools(const ToolNames& tools) override { inner_->set_tools(tools); }
    double duration_s() const override { return inner_->duration_s(); }
    int recorded_readings() const override { return inner_->recorded_readings(); }
    double recorded_time_s(int i) const override { return inner_->recorded_time_s(i); }
    double next_s() const override;
    std::span<const SessionSample> passed_over() const override { return inner_->passed_over(); }

  private:
    std::unique_ptr<Tracker> inner_;
    std::atomic<double> speed_{1}, jump_s_{0}, at_s_{0};
    std::atomic<bool> stands_at_end_{false};
    bool started_ = false;
    double last_s_ = 0, inner_s_ = 0;
};

}  // namespace sonocase::runtime::inline tracking
