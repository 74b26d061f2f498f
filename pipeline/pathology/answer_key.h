// SPDX-License-Identifier: Apache-2.0

// The answer key: what was put where, measured on the painted voxels.
#pragma once

#include <vector>

#include "formats/base/stage_report.h"
#include "pipeline/pathology/label_canvas.h"
#include "pipeline/pathology/place_pathology.h"

namespace sonocase::pipeline::inline pathology {

// Fills in what the voxels say: centre (their centroid, or the voxel nearest to it where the
// centroid lies outside), volume, diameters (of the ellipsoid with the same moments, falling),
// depth below the skin and nearest vessel (searched up to 40 mm), digest.
// inside: the lesion's label and those of its inner parts; range holds all of their voxels.
void measure_lesion(const LabelVolume& volume,
                    const VoxelRange& range,
                    const LabelSet& inside,
                    const LabelSet& vessels,
                    PathologyEntry& entry);

// Writes the key into the report of the stage, and reads it back.
void add_key(const std::vector<PathologyEntry>& key, StageReport& report);
std::vector<PathologyEntry> key_of(const StageReport& report);

}  // namespace sonocase::pipeline::inline pathology
