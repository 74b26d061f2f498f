// SPDX-License-Identifier: Apache-2.0

// Targets on the picture, for who may see them: the instructor.
#pragma once

#include <string>
#include <vector>

#include "runtime/player/ui/picture/image_view.h"

namespace sonocase::runtime {

struct TargetMark {
    Point3 centre;  // `probe` frame
    double radius_mm = 0;
    bool reached = false;
    std::string name;
};

// A ring where the scan plane cuts a target; beside the plane a dotted ring of the target's size,
// with the distance to the plane. flipped: left and right are exchanged.
void draw_target_marks(Ui& ui,
                       const ImagePlace& place,
                       const std::vector<TargetMark>& targets,
                       bool flipped);

}  // namespace sonocase::runtime
