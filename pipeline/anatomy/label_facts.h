// SPDX-License-Identifier: Apache-2.0

// What the kinds of structure need to know of each label of a volume: its tissue, the kind of
// structure drawn in it, its position and shape.
#pragma once

#include <cstdint>
#include <vector>

#include "formats/volume/label_volume.h"
#include "formats/volume/tissue.h"

namespace sonocase::pipeline::inline anatomy {

enum class StructureRole : std::uint8_t {
    none,   // outside, fluid, gas, bone
    plain,  // parenchyma noise only
    liver,
    kidney,
    muscle,
    fat,
    bowel,
};

// Positions are voxel coordinates.
struct LabelFacts {
    const Tissue* tissue = nullptr;
    StructureRole role = StructureRole::none;                  // none for a label without voxels
    std::int64_t count = 0;                                    // voxels
    Int3 lower{1 << 30, 1 << 30, 1 << 30}, upper{-1, -1, -1};  // bounding box, inclusive
    Vector3 mean;
    Matrix3 axes;             // columns: principal axes, longest first
    Vector3 spread{0, 0, 0};  // standard deviation along them, voxels
};

// # palette. tissue_of: # palette, not null. The sums are integers: the result is the same for any
// number of threads. Cost: one pass over the voxels.
std::vector<LabelFacts> label_facts(const LabelVolume& labels,
                                    const std::vector<const Tissue*>& tissue_of);

}  // namespace sonocase::pipeline::inline anatomy
