// SPDX-License-Identifier: Apache-2.0

// The answer key: what was put where, measured on the painted voxels.
#pragma once

#include <vector>

#include "formats/base/stage_report.h"
#include "pipeline/pathology/label_canvas.h"
#include "pipeline/pathology/pathology.h"

namespace sonocase::pipeline {

// Fills in what the voxels say: centre (their centroid, or the voxel nearest to it where the
// centroid lies outside), volume, diameters (of the ellipsoid with the same moments, falling),
// depth below the skin and nearest vessel (40 mm at most are looked at), digest.
// inside: the lesion's label and those of its inner parts; range holds all of their voxels.
void measure_lesion(const LabelVolume& volume,
                    const VoxelRange& range,
                    const Labels& inside,
                    const Labels& vessels,
                    PathologyEntry& entry);

// The key as part of the stage's report, and back.
void add_key(const std::vector<PathologyEntry>& key, StageReport& report);
std::vector<PathologyEntry> key_of(const StageReport& report);

}  // namespace sonocase::pipeline
