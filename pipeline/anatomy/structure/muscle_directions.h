// SPDX-License-Identifier: Apache-2.0

// Directions of muscle fibres: along the axis of a long muscle, or around the body in a muscle that
// is a sheet.
#pragma once

#include <vector>

#include "formats/volume/label_volume.h"
#include "pipeline/anatomy/structure/coarse_field.h"
#include "pipeline/anatomy/structure/label_facts.h"

namespace sonocase::pipeline {

struct FibreField {
    int label = 0;       // palette index
    Vector3 axis;        // unit vector along the muscle, frame of the grid
    bool sheet = false;  // fibres run around the body at a slant instead of along `axis`
};

struct MuscleDirections {
    std::vector<FibreField> fields;  // # palette; label 0: not a muscle
    Vector3 up{0, 0, 1};             // towards the head or the feet
    const CoarseField* skin_depth = nullptr;

    // Unit vector at a voxel of a muscle.
    Vector3 at(int label, float i, float j, float k) const;
};

// skin_depth: depth below the skin, voxels; must outlive the result; null: no muscle is a sheet.
MuscleDirections find_muscle_directions(const LabelVolume& labels,
                                        const std::vector<LabelFacts>& facts,
                                        const CoarseField* skin_depth);

}  // namespace sonocase::pipeline
