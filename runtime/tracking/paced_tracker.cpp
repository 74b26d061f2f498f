// SPDX-License-Identifier: Apache-2.0

#include "runtime/tracking/paced_tracker.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <utility>

namespace sonocase::runtime {

PacedTracker::PacedTracker(std::unique_ptr<Tracker> inner) : inner_(std::move(inner)) {
    assert(inner_ && inner_->duration_s() >= 0);
}

void PacedTracker::set_speed(double speed) {
    speed_ = std::isfinite(speed) ? std::clamp(speed, 0.0, 16.0) : 1;
}

bool PacedTracker::poll(double now_s, TrackerReading& reading) {
    if (!started_) {
        last_s_ = now_s;
        TrackerReading first;  // the inner tracker's time starts here
        started_ = inner_->poll(0, first);
        if (started_) {
            reading = first;
            reading.time_s = now_s;
        }
        return started_;
    }
    inner_s_ += (now_s - last_s_) * speed_ + jump_s_.exchange(0);
    last_s_ = now_s;
    const double duration = inner_->duration_s();
    // Back from the start is the end, as in a loop.
    if (inner_s_ < 0) inner_s_ = duration > 0 ? duration + std::fmod(inner_s_, duration) : 0;
    at_s_ = duration > 0 ? std::fmod(inner_s_, duration) : 0;
    if (!inner_->poll(inner_s_, reading)) return false;
    const double late_s = speed_ > 0 ? (inner_s_ - reading.time_s) / speed_ : 0;
    reading.time_s = now_s - std::max(0.0, late_s);
    return true;
}

double PacedTracker::next_s() const {
    const double inner = inner_->next_s(), speed = speed_;
    if (inner < 0 || speed == 0) return -1;
    return last_s_ + std::max(0.0, inner - inner_s_) / speed;
}

}  // namespace sonocase::runtime
