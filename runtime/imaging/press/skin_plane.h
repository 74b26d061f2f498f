// SPDX-License-Identifier: Apache-2.0

// Where the skin runs within voxels, from their boundary records.
#pragma once

#include <optional>

#include "formats/bundle/streamed_bundle.h"

namespace sonocase::runtime::press {

// inside(p) = distance_vx + inward . (p - voxel), in voxels: positive in the body.
struct SkinPlane {
    Point3 voxel;
    double distance_vx = 0;
    Vector3 inward{0, 0, 1};  // unit
    double inside(Point3 p) const { return distance_vx + dot(inward, p - voxel); }
};

// Nothing where the voxel has no record, or one of a surface between two tissues. voxel: in the
// bundle's grid. Its block is unpacked where it is not yet. Constant time; neither allocates nor
// throws.
std::optional<SkinPlane> skin_plane_of(const CaseView& bundle, Int3 voxel);

// Where a line meets the skin, in multiples of step beyond p. p: the first place on the line, in
// voxels, whose voxel lies in the body; step: at most a voxel. No farther than a voxel's diagonal.
// 0: no record says it, or the line runs along the skin.
double steps_to_skin(const CaseView& bundle, Point3 p, Vector3 step);

}  // namespace sonocase::runtime::press
