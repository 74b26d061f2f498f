// SPDX-License-Identifier: Apache-2.0

// Surfaces on a beam's way in the reference renderer: those between tissues, and those of targets.
#pragma once

#include <array>

#include "runtime/imaging/physical/reference/reference_input.h"
#include "runtime/imaging/physical/reference/reference_place.h"

namespace sonocase::runtime {

// A sample on its way through the effects.
struct Sample {
    const physical::Row& row;
    Vector3 from_origin{};    // of the volume, mm, before the slab's random step
    Point3 v{}, looked_up{};  // voxel coordinates: the sample, and the voxel that is asked
    Place place{};
    int look_index = 0;
    double re = 0, im = 0;                                           // echo of surfaces
    std::array<double, physical::kMaxLooks> field_re{}, field_im{};  // of scatterers, one per look
    double facing = 1;  // how squarely the beam meets the surface, 1 where there is none
    double loss = 0;    // log2 of amplitude that this sample takes
    double here = 0;    // amplitude of the light that arrives
};

// The surface between two labels: its echo, and what it takes. beam: unit, frame `mannequin`.
void meet_surface(const ReferenceInput& in, Vector3 beam, Sample& p);
// The target that the sample lies in, if any: the last one. Soft tissue alone gives way to it.
void find_target(const ReferenceInput& in, Sample& p);
// The surfaces of targets that are near.
void meet_targets(const ReferenceInput& in, Vector3 beam, Sample& p);

}  // namespace sonocase::runtime
