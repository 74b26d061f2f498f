// SPDX-License-Identifier: Apache-2.0

// Surfaces of structures for the 3-D pictures, from a bundle's labels. Internal to pipeline/review.
#pragma once

#include <vector>

#include "formats/bundle/case_bundle.h"
#include "formats/volume/surface.h"

namespace sonocase::pipeline {

// The smoothed surface round the voxels whose label is chosen (# 256), taken at every `step`-th
// voxel. Mannequin frame, mm; without normals; empty if no voxel is chosen.
Surface label_surface(const CaseBundle& bundle, const std::vector<bool>& chosen, int step);

}  // namespace sonocase::pipeline
