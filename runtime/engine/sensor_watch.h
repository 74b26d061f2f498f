// SPDX-License-Identifier: Apache-2.0

// Notices a sensor that cannot be trusted: frozen, jumping or silent. Devices report such readings
// as good.
#pragma once

#include "runtime/engine/tracker_reading.h"

namespace sonocase::runtime {

struct SensorWatchOptions {
    double stale_after_s = 0.25;   // no new reading
    double frozen_after_s = 0.5;   // readings arrive, but no bit of the pose changes
    double top_speed_mm_s = 3000;  // faster than a hand moves a probe
    double jump_shown_s = 1.0;     // how long a jump stays on screen
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
    void observe(const SensorReading& reading, double time_s, bool is_device);
    SensorVerdict verdict(double now_s) const;
    // True if the last observed pose should not be shown: a jump that no second reading has
    // confirmed yet. Two readings that agree are believed.
    bool hold() const { return hold_; }
    int jumps() const { return jumps_; }

  private:
    SensorWatchOptions options_;
    bool seen_ = false, device_ = false, hold_ = false;
    SensorReading last_;
    Rigid trusted_;
    double last_s_ = 0, changed_s_ = 0, jump_s_ = -1e9;
    double trusted_s_ = -1;  // negative: no usable pose yet
    int jumps_ = 0;
};

}  // namespace sonocase::runtime
