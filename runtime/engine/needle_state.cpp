// SPDX-License-Identifier: Apache-2.0

#include "runtime/engine/needle_state.h"

#include <algorithm>

#include "formats/base/portable_math.h"
#include "formats/scoring/anatomy.h"

namespace sonocase::runtime::inline engine {

double needle_constraint_weight(double depth_mm, const NeedleConstraintOptions& options) {
    const double l = std::max(depth_mm, 0.0);
    return options.max_weight /
           (1 + exponential(-options.steepness_per_mm * (l - options.midpoint_mm)));
}

Vector3 constrain_needle_direction(Vector3 entry_world,
                                   Vector3 measured_world,
                                   double depth_mm,
                                   const NeedleConstraintOptions& options) {
    const double w = needle_constraint_weight(depth_mm, options);
    const Vector3 blend = w * entry_world + (1 - w) * measured_world;
    // Unit vectors blend to something shorter than a millionth only when they are opposite; what is
    // left then is rounding, not a direction.
    if (!(norm(blend) > 1e-6)) return measured_world;
    return normalized(blend);
}

namespace {

// Turns the measured frame by the smallest rotation that brings its z onto `z`, so that the needle
// does not spin when it bends.
Matrix3 turned_onto(const Matrix3& measured, Vector3 z) {
    const Vector3 from = measured.column(2);
    const Vector3 axis = cross(from, z);
    const double sine = norm(axis);
    if (!(sine > 1e-12)) return measured;
    // Without cancellation up to a right angle, beyond which the difference has none.
    const double cosine = dot(from, z);
    const double less = cosine > 0 ? sine * sine / (1 + cosine) : 1 - cosine;
    return rotation_about(axis / sine, sine, less) * measured;
}

}  // namespace

NeedleConstraintOptions constraint_of(const NeedleModel& needle) {
    return {needle.bend_max_weight, needle.bend_alpha_per_m / 1000, needle.bend_delta_m * 1000};
}

NeedleState::NeedleState(const Anatomy* anatomy,
                         const NeedleModel& needle,
                         const InsertionOptions& options)
    : anatomy_(anatomy),
      constraint_(constraint_of(needle)),
      length_mm_(needle.length_mm),
      detector_(options) {}

NeedleView NeedleState::update(double time_s, const Rigid& measured) {
    NeedleView view;
    view.mannequin_from_drawn = measured;
    if (!anatomy_ || !is_finite(measured)) return view;
    const Vector3 at = measured.translation;
    const Point3 tip{at.x, at.y, at.z};
    const Vector3 direction = measured.rotation.column(2);
    Point3 skin;
    const double depth = insertion_depth_mm(*anatomy_, tip, direction, length_mm_, &skin);
    view.change = detector_.update(time_s, depth, direction, skin);
    view.inserted = detector_.inserted();
    view.depth_mm = std::max(depth, 0.0);
    if (!view.inserted || view.depth_mm == 0) return view;
    const Vector3 drawn = constrain_needle_direction(detector_.entry_direction(), direction,
                                                     view.depth_mm, constraint_);
    const double w = needle_constraint_weight(view.depth_mm, constraint_);
    const Point3 through = skin + w * (detector_.entry_point() - skin);
    const Point3 drawn_tip = through + view.depth_mm * drawn;
    view.mannequin_from_drawn = {turned_onto(measured.rotation, drawn), drawn_tip - Point3{}};
    return view;
}

}  // namespace sonocase::runtime::inline engine
