// SPDX-License-Identifier: Apache-2.0

// A recording or script at another speed, or from another place: for the tracker inside, time runs
// faster or slower, or jumps. Speed and place are set from any thread; one thread polls.
#pragma once

#include <atomic>
#include <memory>

#include "runtime/tracking/tracker.h"

namespace sonocase::runtime {

class PacedTracker final : public Tracker {
  public:
    // inner: a function of time with an end, such as a replay or a sweep.
    explicit PacedTracker(std::unique_ptr<Tracker> inner);

    void set_speed(double speed);  // in [0, 16]; 0 stands still
    double speed() const { return speed_.load(); }
    // Forward, or back where seconds < 0, with the next poll.
    void jump(double seconds) { jump_s_.fetch_add(seconds); }
    double at_s() const { return at_s_.load(); }  // in [0, duration_s()), at the last poll

    bool poll(double now_s, TrackerReading& reading) override;
    TrackerHealth health() const override { return inner_->health(); }
    double duration_s() const override { return inner_->duration_s(); }
    int recorded_readings() const override { return inner_->recorded_readings(); }
    double recorded_time_s(int i) const override { return inner_->recorded_time_s(i); }
    double next_s() const override;

  private:
    std::unique_ptr<Tracker> inner_;
    std::atomic<double> speed_{1}, jump_s_{0}, at_s_{0};
    bool started_ = false;
    double last_s_ = 0, inner_s_ = 0;
};

}  // namespace sonocase::runtime
