// SPDX-License-Identifier: Apache-2.0

// Solid textures and the speckle volume. Both repeat seamlessly in x, y and z.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace sonocase {

// Grey texture of edge^3 voxels, x fastest. Grey 128 is the tissue's mean; the tissue table gives
// mean and spread, so that a texture can be shared: grey = mean + (value - 128) / 32 * sd.
struct SolidTexture {
    std::string name;
    int edge = 0;                      // voxels, power of two in 8..128
    double voxel_mm = 0.5;             // size of a texture voxel in tissue
    std::vector<std::uint8_t> voxels;  // # edge^3
};

// Complex unit-variance Gaussian scatterers, edge^3 pairs (real, imaginary), x fastest.
// Value v stands for v / 32, so +-4 standard deviations fit.
struct SpeckleVolume {
    int edge = 0;                     // power of two
    std::vector<std::int8_t> voxels;  // # 2 * edge^3
};

}  // namespace sonocase
