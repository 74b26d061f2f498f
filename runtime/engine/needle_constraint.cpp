// SPDX-License-Identifier: Apache-2.0

#include "runtime/engine/needle_constraint.h"

#include <algorithm>

#include "formats/base/portable_math.h"

namespace sonocase::runtime {

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

}  // namespace sonocase::runtime
