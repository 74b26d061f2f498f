// SPDX-License-Identifier: Apache-2.0

// Notices sensors that cannot be trusted: a pose sensor that is frozen, jumping or silent, and a
// force sensor whose values are impossible or frozen. Devices report such readings as good.
#pragma once

#include "runtime/engine/tracker_reading.h"

namespace sonocase::runtime::inline engine {

struct ForceWatchOptions {
    double max_n = 100;          // more is a fault of the sensor
    double max_n_s = 400;        // a hand's tap rises no faster
    double frozen_after_s = 1;   // no bit of a force above min_n changes
    double min_n = 0.2;          // less counts as 0
    double min_change_n = 0.05;  // a smaller change is not worth solving again
};

// Filters the readings of a force sensor: a value that is not a number, one that jumps faster than
// a hand presses, or one that never changes is not trusted and leaves the last force as it was. A
// sensor that freezes while it is pressed counts as released after a second, so that the picture
// does not stay pressed for ever.
class ForceWatch {
  public:
    explicit ForceWatch(const ForceWatchOptions& options = {}) : options_(options) {}

    // Call this with every reading; force_n negative: the tracker has no such sensor.
    void observe(double force_n, double time_s);
    bool present() const { return present_; }
    bool frozen() const { return frozen_; }
    double force_n() const { return force_n_; }  // trusted; 0 while frozen
    // The trusted force has changed since taken().
    bool fresh() const { return fresh_; }
    void taken() { fresh_ = false; }

  private:
    void trust(double force_n);

    ForceWatchOptions options_;
    bool present_ = false, frozen_ = false, fresh_ = false;
    double force_n_ = 0;
    double trusted_s_ = 0;                // time of the last reading that was believed
    double last_n_ = -1, changed_s_ = 0;  // the last reading, believed or not
    double last_s_ = 0;
};

struct SensorWatchOptions {
    double stale_after_s = 0.25;   // no new reading of this sensor
    double frozen_after_s = 0.5;   // readings arrive, but no bit of the pose changes
    double top_speed_mm_s = 3000;  // faster than a hand moves a probe
    double jump_shown_s = 1.0;     // how long a jump stays on screen
    // A sensor whose noise changed noisy_readings readings on end, each within noisy_step_s of the
    // one before, is lost once its pose repeats to the last bit for repeated_after_s, while others
    // change repeated_readings times: its sender goes on with the last pose.
    int noisy_readings = 4, repeated_readings = 5;
    double noisy_step_s = 0.25, repeated_after_s = 0.2;
};

enum class SensorVerdict : std::uint8_t { fine, absent, lost, stale, frozen, jumped, poor };

// A sentence for the trainee; "" for fine and absent.
const char* verdict_sentence(SensorVerdict verdict);

// One per sensor. Constant time, no allocation.
class SensorWatch {
  public:
    explicit SensorWatch(SensorWatchOptions options = {}) : options_(options) {}
    // Called with every reading. is_device: only hardware can be frozen or stale, or jump; see
    // Tracker::is_device.
    // others_moved: the pose of another sensor has changed since the last call.
    void observe(const SensorReading& reading,
                 double time_s,
                 bool is_device,
                 bool others_moved = false);
    SensorVerdict verdict(double now_s) const;
    // True if the sensor has no pose that can be believed now: its device says so, it is not a
    // number or beyond kFarthestMm, it has been silent, or its sender repeats what it once was.
    bool lost(double now_s) const;
    // Of the pose last believed. 0 for what is no device: its poses are of the moment they are for.
    double age_s(double now_s) const { return device_ && fresh_s_ >= 0 ? now_s - fresh_s_ : 0; }
    // True if the last observed pose should not be shown: a jump that no second reading has
    // confirmed yet. Two readings that agree are believed; of a sensor with noise, two that are
    // equal to the last bit are not, because senders repeat a default pose so.
    bool hold() const { return hold_; }
    int jumps() const { return jumps_; }

  private:
    SensorWatchOptions options_;
    bool seen_ = false, device_ = false, hold_ = false, usable_ = false, repeated_ = false;
    // The sender goes on with the last pose of a tool that it has lost.
    bool repeats() const { return repeated_ && rests_ <= 0; }

    // A source that mostly goes on within 1 mm of where it rested to the last bit has no noise: a
    // simulation. Rests less losses: above 0 it is one.
    int rests_ = 0;
    int noisy_ = 0, others_ = 0;  // changes on end; of others since the last
    SensorReading last_;
    Rigid trusted_;
    double last_s_ = 0, changed_s_ = 0, jump_s_ = -1e9;
    double fresh_s_ = -1;    // of the last pose that was measured and believed
    double trusted_s_ = -1;  // negative: no usable pose yet
    int jumps_ = 0;
};

}  // namespace sonocase::runtime::inline engine
