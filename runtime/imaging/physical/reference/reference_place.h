// SPDX-License-Identifier: Apache-2.0

// What lies at a point of the volume, for the reference renderer. Points are voxel coordinates.
#pragma once

#include "runtime/imaging/physical/model/physical_frame.h"

namespace sonocase::runtime {

int nearest_integer(double x);

// Roughness of a surface at a point.
struct Roughness {
    double shift = 0;       // of the surface, in kRoughnessMm
    double log2_glint = 0;  // of the echo's amplitude
    double re = 1, im = 0;  // the echo's phase
};
Roughness roughness_at(const PhysicalScene& scene, Point3 v);

// The label at a point, and the surface beside it if there is one.
struct Place {
    int label = 0;             // on the side of the surface where the point lies
    int own = 0, second = -1;  // labels on both sides; second < 0: no surface near
    double distance_mm = 0;    // > 0 on own's side
    Vector3 normal;
    Roughness rough;
};

// near: a random point less than a voxel away from v. Its voxel is looked up, and the plane that it
// stores is extended to v; where no plane is stored, the random step blends neighbouring voxels.
// Where v lies in the fine region, the step is as many of its voxels.
Place place_at(const PhysicalScene& scene, const PhysicalFrame& frame, Point3 v, Point3 near);

// Echo offsets, dB: the baked one of the nearest voxel; that of the label's fibres or septa.
double echo_offset_db(const PhysicalScene& scene, Point3 v);
double fine_offset_db(const PhysicalScene& scene, const PhysicalEffects& on, int label, Point3 v);

}  // namespace sonocase::runtime
