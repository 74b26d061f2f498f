// SPDX-License-Identifier: Apache-2.0

#include "runtime/tracking/scripted_sweep.h"

#include <algorithm>
#include <cmath>

namespace sonocase::runtime::inline tracking {
namespace {

Vector3 as_vector(Point3 p) {
    return {p.x, p.y, p.z};
}
Point3 as_point(Vector3 v) {
    return {v.x, v.y, v.z};
}

// Value at u in [0, 1] between keys i and i + 1; `get` reads the vector of a key.
template <class Get>
Vector3 hermite(const std::vector<SweepKey>& keys, std::size_t i, double u, Get get) {
    const std::size_t before = i > 0 ? i - 1 : i, after = i + 2 < keys.size() ? i + 2 : i + 1;
    const auto slope = [&](std::size_t a, std::size_t b) {
        const double dt = keys[b].time_s - keys[a].time_s;
        return dt > 0 ? (get(keys[b]) - get(keys[a])) / dt : Vector3{};
    };
    const double span = keys[i + 1].time_s - keys[i].time_s;
    const Vector3 m0 = span * slope(before, i + 1), m1 = span * slope(i, after);
    const double u2 = u * u, u3 = u2 * u;
    return (2 * u3 - 3 * u2 + 1) * get(keys[i]) + (u3 - 2 * u2 + u) * m0 +
           (3 * u2 - 2 * u3) * get(keys[i + 1]) + (u3 - u2) * m1;
}

}  // namespace

Rigid frame_along(Point3 origin, Vector3 z, Vector3 x_hint) {
    z = normalized(z);
    if (norm(z) == 0) z = {0, 0, 1};
    Vector3 x = x_hint - dot(x_hint, z) * z;
    x = norm(x) > 1e-6 ? normalized(x) : any_perpendicular(z);
    return {Matrix3::from_columns(x, cross(z, x), z), as_vector(origin)};
}

SweepPose sweep_pose(const Sweep& sweep, double time_s, const Skin* skin) {
    const auto& keys = sweep.keys;
    SweepPose pose;
    if (keys.empty()) return pose;
    const auto later =
        std::upper_bound(keys.begin(), keys.end(), time_s,
                         [](double t, const SweepKey& key) { return t < key.time_s; });
    Vector3 probe, beam, lateral, tip, shaft;
    if (later == keys.begin() || later == keys.end()) {
        const SweepKey& key = later == keys.begin() ? keys.front() : keys.back();
        probe = as_vector(key.probe), beam = key.beam, lateral = key.lateral;
        tip = as_vector(key.needle_tip), shaft = key.needle_direction;
        pose.has_needle = key.has_needle;
    } else {
        const std::size_t i = static_cast<std::size_t>(later - keys.begin()) - 1;
        const double u = (time_s - keys[i].time_s) / (keys[i + 1].time_s - keys[i].time_s);
        probe = hermite(keys, i, u, [](const SweepKey& k) { return as_vector(k.probe); });
        beam = hermite(keys, i, u, [](const SweepKey& k) { return normalized(k.beam); });
        lateral = hermite(keys, i, u, [](const SweepKey& k) { return normalized(k.lateral); });
        pose.has_needle = keys[i].has_needle && keys[i + 1].has_needle;
        if (pose.has_needle) {
            // Along a straight line: the keys beside these two may have no needle to take a tangent
            // from, and a needle is pushed straight.
            tip = (1 - u) * as_vector(keys[i].needle_tip) + u * as_vector(keys[i + 1].needle_tip);
            shaft = (1 - u) * normalized(keys[i].needle_direction) +
                    u * normalized(keys[i + 1].needle_direction);
        }
    }
    beam = normalized(beam);
    Point3 face = as_point(probe);
    if (sweep.snap_to_skin && skin) {
        if (const auto touch = skin->project(face, beam, 80)) face = *touch;
    }
    pose.mannequin_from_probe = frame_along(face, beam, lateral);
    if (pose.has_needle) {
        // The bevel faces the probe, as an expert holds it.
        pose.mannequin_from_needle = frame_along(as_point(tip), shaft, -beam);
    }
    return pose;
}

double ScriptedSweep::duration_s() const {
    return sweep_.keys.empty() ? 0 : sweep_.keys.back().time_s - sweep_.keys.front().time_s;
}

ScriptedSweep::ScriptedSweep(Sweep sweep, const Skin& skin, bool loop)
    : sweep_(std::move(sweep)), skin_(skin), loop_(loop) {
    if (std::none_of(sweep_.keys.begin(), sweep_.keys.end(),
                     [](const SweepKey& key) { return key.acts.count > 0; }))
        return;
    const int count = static_cast<int>(duration_s() * kPassedRateHz) + 1;
    for (int i = 0; i < count; ++i) {
        SessionSample sample;
        sample.time_s = i / kPassedRateHz;
        const SweepPose pose =
            sweep_pose(sweep_, sweep_.keys.front().time_s + sample.time_s, &skin_);
        sample.probe_ok = true;
        sample.mannequin_from_probe = pose.mannequin_from_probe;
        sample.needle_ok = pose.has_needle;
        sample.mannequin_from_needle = sample.mannequin_from_drawn = pose.mannequin_from_needle;
        add_acts(sample.time_s, sample.acts);
        samples_.push_back(sample);
        acted_by_.push_back(acted_);
    }
    acted_ = 0;
}

void ScriptedSweep::add_acts(double t, ActList& acts) {
    // PacedTracker stops a little before the end, and the last key's acts are performed there.
    constexpr double kEarlyS = 1e-5;
    while (acted_ < sweep_.keys.size()) {
        const SweepKey& key = sweep_.keys[acted_];
        if (key.time_s - sweep_.keys.front().time_s > t + kEarlyS) break;
        // What does not fit comes with the next reading.
        if (acts.count + key.acts.count > ActList::kMaxActs) break;
        for (int i = 0; i < key.acts.count; ++i)
            acts.add(key.acts.acts[static_cast<std::size_t>(i)]);
        ++acted_;
    }
}

std::span<const SessionSample> ScriptedSweep::passed_over() const {
    return std::span(samples_).first(passed_);
}

bool ScriptedSweep::poll(double now_s, TrackerReading& reading) {
    if (sweep_.keys.empty()) return false;
    if (!started_) start_s_ = now_s, started_ = true;
    double t = now_s - start_s_;
    const double duration = duration_s();
    over_ = !loop_ && t > duration;
    if (loop_ && duration > 0) t = std::fmod(t, duration);
    const SweepPose pose = sweep_pose(sweep_, sweep_.keys.front().time_s + t, &skin_);
    reading = {};
    reading.sequence = ++sequence_;
    reading.time_s = now_s;
    reading.device_time_s = t;
    reading.in_mannequin = true;
    reading.sensor_count = 2;
    reading.sensors[kProbeSensor] = {SensorState::ok, pose.mannequin_from_probe, 1.0f, 0};
    if (pose.has_needle) {
        reading.sensors[kNeedleSensor] = {SensorState::ok, pose.mannequin_from_needle, 1.0f, 0};
    }
    // Acts of the time that is left out would do something else without their poses: they come with
    // the samples passed over.
    passed_ = 0;
    if (!samples_.empty() && (t < last_t_ || (jumps_ && t > last_t_))) {
        reading.restarts = true;
        acted_ = 0;
        while (passed_ < samples_.size() && samples_[passed_].time_s < t)
            acted_ = acted_by_[passed_++];
    }
    jumps_ = false;
    last_t_ = t;
    add_acts(t, reading.acts);
    return true;
}

TrackerHealth ScriptedSweep::health() const {
    TrackerHealth health;
    health.phase = over_ ? TrackerPhase::ended : TrackerPhase::streaming;
    health.device = Message("Script {}", {sweep_.name});
    health.readings = sequence_;
    return health;
}

}  // namespace sonocase::runtime::inline tracking
