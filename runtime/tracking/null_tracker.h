// SPDX-License-Identifier: Apache-2.0

// A tracker that holds one pose, to look at a bundle without a tracker and for tests.
#pragma once

#include "runtime/tracking/tracker.h"

namespace sonocase::runtime {

class NullTracker final : public Tracker {
  public:
    explicit NullTracker(const Rigid& mannequin_from_probe) {
        reading_.in_mannequin = true;
        reading_.sensor_count = 1;
        reading_.sensors[kProbeSensor] = {SensorState::ok, mannequin_from_probe, 1.0f, 0};
    }
    bool poll(double now_s, TrackerReading& reading) override {
        reading_.time_s = now_s;
        ++reading_.sequence;
        reading = reading_;
        return true;
    }
    TrackerHealth health() const override {
        TrackerHealth health;
        health.phase = TrackerPhase::streaming;
        health.device = "No tracker";
        health.message = "No tracker is in use; the probe stays where the exercise starts.";
        health.readings = reading_.sequence;
        return health;
    }

  private:
    TrackerReading reading_;
};

}  // namespace sonocase::runtime
