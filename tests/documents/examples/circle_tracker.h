// SPDX-License-Identifier: Apache-2.0

// A tracker that leads the probe once round a circle: a function of time, without a thread.
#pragma once

#include <cmath>

#include "formats/base/constants.h"
#include "runtime/tracking/tracker.h"

namespace sonocase::runtime::inline tracking {

class CircleTracker final : public Tracker {
  public:
    // start       mannequin_from_probe at time 0
    // radius_mm   of the circle in the plane of the skin, >= 0; once round in 8 seconds
    CircleTracker(const Rigid& start, double radius_mm) : start_(start), radius_mm_(radius_mm) {}

    bool poll(double now_s, TrackerReading& reading) override {
        const double angle_rad = 2 * kPi * now_s / duration_s();
        const Vector3 offset_probe{radius_mm_ * std::sin(angle_rad),
                                   radius_mm_ * (1 - std::cos(angle_rad)), 0};
        Rigid pose = start_;
        pose.translation = pose.translation + start_.rotation * offset_probe;
        reading = {};
        reading.sequence = ++readings_;
        reading.time_s = now_s;
        reading.in_mannequin = true;  // poses of the probe itself: no calibration applies
        reading.sensor_count = 1;
        reading.sensors[kProbeSensor] = {SensorState::ok, pose, 1.0f, 0};
        return true;
    }
    TrackerHealth health() const override {
        TrackerHealth health;
        health.phase = TrackerPhase::streaming;
        health.device = "Circle";
        health.readings = readings_;
        return health;
    }
    double duration_s() const override { return 8; }

  private:
    Rigid start_;
    double radius_mm_;
    std::uint64_t readings_ = 0;
};

}  // namespace sonocase::runtime::inline tracking
