// SPDX-License-Identifier: Apache-2.0

// Directions of muscle fibres: along the axis of a long muscle, or around the body in a muscle that
// is a sheet.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "formats/base/geometry.h"
#include "formats/volume/label_volume.h"
#include "pipeline/anatomy/coarse_field.h"
#include "pipeline/anatomy/label_facts.h"
#include "pipeline/anatomy/structure_noise.h"

namespace sonocase::pipeline::inline anatomy {

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

// Noise of muscle fascicles: isotropic noise, elongated along the fibres by a weighted sum of
// samples along them. Unit variance.

class FibreNoise {
  public:
    // Thickness: 2 voxels, at least 1.6 mm.
    FibreNoise(double voxel_mm, std::uint64_t seed);

    // Position in mm in any fixed frame; `along`: unit vector along the fibres. Cost: nine samples.
    float at(float x_mm, float y_mm, float z_mm, Vector3 along) const;

  private:
    static constexpr int kReach = 4;  // samples on either side
    StructureNoise noise_;
    std::array<float, 2 * kReach + 1> weight_{};
};

}  // namespace sonocase::pipeline::inline anatomy
