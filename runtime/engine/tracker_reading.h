// SPDX-License-Identifier: Apache-2.0

// What a tracker reports about all its sensors at one moment. Time is injected: seconds on the
// session's clock.
#pragma once

#include <array>
#include <cmath>
#include <cstdint>

#include "formats/base/geometry.h"
#include "formats/recording/acts.h"

namespace sonocase::runtime::inline engine {

inline constexpr int kMaxSensors = 16;
inline constexpr int kProbeSensor = 0;  // unless the sensors are assigned otherwise
inline constexpr int kNeedleSensor = 1;
// Fixed to the mannequin, where a tracker knows its sensors by name.
inline constexpr int kReferenceSensor = 2;

enum class SensorState : std::uint8_t {
    absent,  // no such sensor
    ok,
    poor,  // a pose of doubtful quality: distorted field, near the edge of the range
    lost,  // the device has no pose; the one given is the last good one
};

// Beyond what any tracker measures: some senders give a huge number for a tool they do not see.
inline constexpr double kFarthestMm = 1e6;

struct SensorReading {
    SensorState state = SensorState::absent;
    Rigid world_from_sensor;
    float quality = -1;        // [0, 1], 1 is best; negative: the device does not say
    std::uint8_t buttons = 0;  // bit 0: the first
    // When this pose arrived, on the session's clock; negative: with the reading. A sender that
    // reports its sensors one by one gives each its own, so that none vouches for another.
    double time_s = -1;
    bool in_mannequin = false;  // as TrackerReading's, of this sensor alone
    bool in_reference = false;  // the pose is relative to the reference sensor already
};

// True if the sensor gives a pose that something measured.
inline bool has_pose(const SensorReading& s) {
    const Vector3& at = s.world_from_sensor.translation;
    return (s.state == SensorState::ok || s.state == SensorState::poor) &&
           is_finite(s.world_from_sensor) && std::abs(at.x) < kFarthestMm &&
           std::abs(at.y) < kFarthestMm && std::abs(at.z) < kFarthestMm;
}

// All sensors at one moment.
struct TrackerReading {
    std::uint64_t sequence = 0;  // rises with every reading of this tracker
    double time_s = 0;           // arrival on the session's clock
    double device_time_s = -1;   // on the device's own clock; negative: it has none
    // The sensors are the tools themselves and `world` is the mannequin: no calibration applies.
    bool in_mannequin = false;
    // Of a recording: the sensors are the tools at their default indices, whatever the user
    // assigned to those of a device, and relative to any reference.
    bool placed = false;
    // Force on the probe's face, newtons, from a force or pressure sensor; negative: there is none.
    double force_n = -1;
    int sensor_count = 0;
    std::array<SensorReading, kMaxSensors> sensors{};
    ActList acts;  // of a script, a recording or a pedal, since the reading before
    // A script or recording does not go on from the reading before: what its acts did is undone,
    // and begins anew with what Tracker::passed_over() gives.
    bool restarts = false;
};

}  // namespace sonocase::runtime::inline engine
