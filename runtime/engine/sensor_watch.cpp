// SPDX-License-Identifier: Apache-2.0

#include "runtime/engine/sensor_watch.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace sonocase::runtime::inline engine {

void ForceWatch::trust(double force_n) {
    const bool lifted = force_n == 0 && force_n_ != 0;
    if (!lifted && std::abs(force_n - force_n_) < options_.min_change_n) return;
    force_n_ = force_n;
    fresh_ = true;
}

void ForceWatch::observe(double force_n, double time_s) {
    if (force_n < 0) return;
    if (!(force_n <= options_.max_n)) return;  // this also rejects what is not a number
    if (!present_) {
        present_ = true;
        trusted_s_ = changed_s_ = time_s;
    }
    const double before_n = last_n_, before_s = last_s_;
    if (force_n != last_n_) changed_s_ = time_s;
    last_n_ = force_n;
    last_s_ = time_s;
    frozen_ = force_n > options_.min_n && time_s - changed_s_ > options_.frozen_after_s;
    if (frozen_) {
        trust(0);
        return;
    }
    // A jump is believed once a second reading confirms it.
    const auto within = [&](double from_n, double from_s) {
        return std::abs(force_n - from_n) <= 1 + options_.max_n_s * std::max(time_s - from_s, 0.0);
    };
    if (!within(force_n_, trusted_s_) && !(before_n >= 0 && within(before_n, before_s))) return;
    trusted_s_ = time_s;
    trust(force_n < options_.min_n ? 0 : force_n);
}

const char* verdict_sentence(SensorVerdict verdict) {
    switch (verdict) {
        case SensorVerdict::fine:
        case SensorVerdict::absent: return "";
        case SensorVerdict::lost:
            return "Out of view or out of range: bring the sensor back to where the tracker sees "
                   "it.";
        case SensorVerdict::stale: return "No new reading: check the cable of the tracker.";
        case SensorVerdict::frozen:
            return "Frozen: readings arrive but never change; replug the sensor.";
        case SensorVerdict::jumped:
            return "Jumped faster than a hand can: check for loose mounts and metal nearby.";
        case SensorVerdict::poor: return "Distorted field: move metal away from the sensor.";
    }
    return "";
}

void SensorWatch::observe(const SensorReading& reading,
                          double arrived_s,
                          bool is_device,
                          bool others_moved) {
    device_ = is_device;
    const double time_s = reading.time_s >= 0 ? reading.time_s : arrived_s;
    if (others_moved) ++others_;
    // What another sensor's message brought along again is no reading of this one.
    const bool again = seen_ && reading.time_s >= 0 && time_s == last_s_ &&
                       reading.state == last_.state &&
                       reading.world_from_sensor == last_.world_from_sensor;
    if (again && reading.state != SensorState::absent) return;
    usable_ = has_pose(reading);
    if (!seen_ || !(reading.world_from_sensor == last_.world_from_sensor)) {
        const double rest_s = time_s - changed_s_;
        const double step =
            norm(reading.world_from_sensor.translation - last_.world_from_sensor.translation);
        if (seen_ && repeated_ && usable_)
            rests_ = step < 1 ? std::min(rests_ + 1, 3) : std::max(rests_ - 1, -20);
        noisy_ = seen_ && rest_s <= options_.noisy_step_s
                     ? std::min(noisy_ + 1, options_.noisy_readings)
                     : 0;
        changed_s_ = time_s;
        others_ = 0;
        repeated_ = false;
    }
    if (device_ && noisy_ >= options_.noisy_readings && others_ >= options_.repeated_readings &&
        time_s - changed_s_ >= options_.repeated_after_s)
        repeated_ = true;
    const bool held = std::exchange(hold_, false);
    if (usable_) {
        if (!seen_ || trusted_s_ < 0) {
            trusted_ = reading.world_from_sensor;
        } else {
            const auto reach = [&](double dt) {
                // 5 mm of grace: the noise of a distorted sensor at 240 Hz is not a jump.
                return 5 + options_.top_speed_mm_s * std::max(dt, 0.0);
            };
            const double moved = norm(reading.world_from_sensor.translation - trusted_.translation);
            const double since_last =
                norm(reading.world_from_sensor.translation - last_.world_from_sensor.translation);
            const bool far = moved > reach(time_s - trusted_s_);
            const bool confirmed =
                last_.state != SensorState::lost && since_last <= reach(time_s - last_s_);
            // A sensor with noise gives no place twice, a sender's default pose is always the same.
            // What stays equal is believed once it is known not to be repeated.
            const bool by_default = held && reading.world_from_sensor == last_.world_from_sensor &&
                                    noisy_ >= options_.noisy_readings && rests_ <= 0 &&
                                    (repeated_ || time_s - changed_s_ < options_.frozen_after_s);
            if (by_default) {
                hold_ = true;
            } else if (far && !confirmed) {
                hold_ = device_;
                if (device_) ++jumps_, jump_s_ = time_s;
            } else {
                trusted_ = reading.world_from_sensor;
            }
        }
        if (!hold_) {
            trusted_s_ = time_s;
            const bool noise = noisy_ >= options_.noisy_readings && rests_ <= 0;
            fresh_s_ = noise ? changed_s_ : time_s;
        }
    }
    last_ = reading;
    last_s_ = time_s;
    seen_ = true;
}

bool SensorWatch::lost(double now_s) const {
    return seen_ &&
           (!usable_ || repeats() || (device_ && now_s - last_s_ > options_.stale_after_s));
}

SensorVerdict SensorWatch::verdict(double now_s) const {
    if (!seen_ || last_.state == SensorState::absent) return SensorVerdict::absent;
    // Others go on: this one is out of view, not its tracker silent.
    if (device_ && now_s - last_s_ > options_.stale_after_s)
        return others_ >= options_.repeated_readings ? SensorVerdict::lost : SensorVerdict::stale;
    if (!usable_ || repeats()) return SensorVerdict::lost;
    if (device_ && last_s_ - changed_s_ > options_.frozen_after_s) return SensorVerdict::frozen;
    if (now_s - jump_s_ < options_.jump_shown_s) return SensorVerdict::jumped;
    if (last_.state == SensorState::poor) return SensorVerdict::poor;
    return SensorVerdict::fine;
}

}  // namespace sonocase::runtime::inline engine
