// SPDX-License-Identifier: Apache-2.0

// Smooth noise in space with a long period: a cube of Gaussian values that wraps, sampled through a
// generic rotation such that its period is along no axis of the body.
#pragma once

#include <cstdint>
#include <vector>

namespace sonocase::pipeline::inline anatomy {

class StructureNoise {
  public:
    // Values with unit variance and a grain (full width at half height of the autocorrelation) of
    // grain_mm; the period is 19 grains. About a megabyte.
    StructureNoise(double grain_mm, std::uint64_t seed);

    // Trilinear; position in mm in any fixed frame.
    float at(float x_mm, float y_mm, float z_mm) const;

  private:
    float scale_;  // cells per mm
    std::vector<float> cells_;
};

}  // namespace sonocase::pipeline::inline anatomy
