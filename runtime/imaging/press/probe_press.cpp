// SPDX-License-Identifier: Apache-2.0

#include "runtime/imaging/press/probe_press.h"

#include <algorithm>
#include <array>
#include <cmath>

namespace sonocase::runtime::press {

ProbePress::ProbePress(const CaseView& bundle, const Exercise& exercise, SimdTarget simd)
    : body_(bundle, {exercise.deformation.venous_pressure_mmhg, simd}),
      field_(press_face(exercise.probe)),
      simd_(simd) {
    exercise_mmhg_ = venous_mmhg_ = exercise.deformation.venous_pressure_mmhg;
    options_.stiffness_scale = exercise.deformation.stiffness_scale;
}

void ProbePress::set_venous_pressure(double mmhg) {
    if (!(mmhg > 0)) mmhg = exercise_mmhg_;
    if (mmhg == venous_mmhg_) return;
    venous_mmhg_ = mmhg;
    body_.set_venous_pressure(mmhg);
    solved_ = false;
}

void ProbePress::press(const Rigid& pose) {
    if (solved_ && pose == pose_) return;
    Rigid touching = pose;
    touching.translation = touching.translation - kTouchMm * pose.rotation.column(2);
    field_.press(simd_, body_.scene(touching), options_);
    pose_ = pose;
    from_mannequin_ = inverse(pose);
    solved_ = true;
}

Rigid ProbePress::at(const Rigid& mannequin_from_probe, double press_mm) {
    Rigid pose = mannequin_from_probe;
    const Vector3 inwards = pose.rotation.column(2);
    if (press_mm > 0)
        pose.translation = pose.translation + std::min(press_mm, kMaxPressMm) * inwards;
    press(pose);
    return held_pose();
}

Rigid ProbePress::held_pose() const {
    Rigid pose = pose_;
    pose.translation = pose.translation - field_.state().excess_mm * pose.rotation.column(2);
    return pose;
}

PressReport ProbePress::report() const {
    const PressState& s = field_.state();
    return {.solved = true,
            .vein_open = s.vein_open,
            .pressed = s.pressed,
            .force_n = s.force_n,
            .pressure_kpa = s.pressed ? s.pressure_kpa : 0,
            .deepest_mm = s.deepest_mm,
            .excess_mm = s.excess_mm,
            .out_of_reach = s.out_of_reach};
}

double ProbePress::press_mm_for(const Rigid& pose, double force_n, double start_mm) {
    // Force grows about as the square of depth, so the depth is interpolated between bounds by the
    // roots of their forces.
    double low = 0, high = kMaxPressMm, at = std::clamp(start_mm, 0.5, 30.0);
    double low_n = 0, high_n = -1;
    for (int step = 0; step < 6; ++step) {
        Rigid deeper = pose;
        deeper.translation = deeper.translation + at * pose.rotation.column(2);
        press(deeper);
        const double n = field_.state().force_n;
        if (std::abs(n - force_n) < 0.02 * force_n) break;
        (n < force_n ? low : high) = at;
        (n < force_n ? low_n : high_n) = n;
        if (high_n < 0) {
            at = std::min(2 * at + 1, 0.5 * (at + kMaxPressMm));
        } else {
            const double a = std::sqrt(low_n), b = std::sqrt(high_n), f = std::sqrt(force_n);
            at = low + (high - low) * std::clamp((f - a) / std::max(b - a, 1e-9), 0.05, 0.95);
        }
    }
    return at;
}

void ProbePress::set_pools(std::span<const SceneChange::Pool> pools) {
    std::array<SceneChange::Pool, SceneChange::kMaxPools> seen;
    std::size_t count = 0;
    for (SceneChange::Pool pool : pools.first(std::min(pools.size(), seen.size()))) {
        pool.centre = from_mannequin_ * pool.centre;
        if (!(pool.radius_mm >= kMinPoolMm) || !std::isfinite(norm(pool.centre - Point3{})))
            continue;
        pool.centre.z += field_.state().excess_mm;  // from the face where bone holds it
        seen[count++] = pool;
    }
    field_.set_pools({seen.data(), count});
}

Point3 ProbePress::at_rest(Point3 now) const {
    return field_.state().pressed ? pose_ * field_.pull_back(from_mannequin_ * now) : now;
}

Point3 ProbePress::current_position(Point3 rest) const {
    return field_.state().pressed ? pose_ * field_.push_forward(from_mannequin_ * rest) : rest;
}

bool ProbePress::closed(Point3 rest) const {
    return field_.state().pressed && field_.closed(from_mannequin_ * rest);
}

}  // namespace sonocase::runtime::press
