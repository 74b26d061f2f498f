// SPDX-License-Identifier: Apache-2.0

// Noise of muscle fascicles: isotropic noise, elongated along the fibres by a weighted sum of
// samples along them. Unit variance.
#pragma once

#include <array>
#include <cstdint>

#include "formats/base/geometry.h"
#include "pipeline/anatomy/structure/structure_noise.h"

namespace sonocase::pipeline {

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

}  // namespace sonocase::pipeline
