// SPDX-License-Identifier: Apache-2.0

// ITK's AntiAliasBinaryImageFilter (Whitaker 2000), the peer of the level sets of eq. (10).
#pragma once

#include <cstdint>
#include <vector>

#include "formats/volume/label_volume.h"

namespace sonocase::bench {

// Its level set of one label, in voxels, negative inside; # voxels. With the filter's own defaults:
// at most 1000 iterations until the mean change is below 0.07 voxel.
std::vector<float> itk_antialiased(const LabelVolume& labels, std::uint8_t label);

}  // namespace sonocase::bench
