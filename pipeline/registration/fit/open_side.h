// SPDX-License-Identifier: Apache-2.0

// The open side of a sweep: where nobody could read, because the body lies on it.
//
// Over a closed surface the mean outward normal is 0; over an open one it points away from the
// hole. A torso is nearly symmetric from front to back, and a pose that is turned front to back
// fits about as well as the right one, so that no gap may decide between them. For a patient on a
// table, the open side is the back.
#pragma once

#include <optional>
#include <string>

#include "formats/base/geometry.h"
#include "pipeline/registration/fit/target_surface.h"

namespace sonocase::pipeline::inline registration_fit {

struct OpenSide {
    // Length of the mean outward normal across the head axis: 0.4 to 0.5 for a sweep of front and
    // flanks, below 0.1 for one all round.
    double size = 0;
    Vector3 direction;  // unit, mannequin frame: towards the hole; zero if size is 0
    // Extent across the body over extent towards the hole. A sweep of one flank is nearly as deep
    // as it is wide, and its open side is not the back; choose_pose finds those that this measure
    // misses.
    double flatness = 0;
    bool open() const { return size > 0.15 && flatness > 1.4; }
    // Weight of |back - direction|^2 in the cost of a pose, mm^2: from 0 for a small opening to
    // 300.
    double weight_mm2() const;
};

// The open side towards a table that was read, which is certain.
OpenSide open_towards(Vector3 direction);

// head  the patient's head direction on the mannequin, if it is known
OpenSide find_open_side(const TargetSurface& target, const std::optional<Vector3>& head);

}  // namespace sonocase::pipeline::inline registration_fit
