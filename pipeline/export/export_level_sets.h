// SPDX-License-Identifier: Apache-2.0

// Labels as OpenVDB level sets, one narrow-band grid each, for tools of computer graphics and
// simulation.
#pragma once

#include <string>
#include <vector>

#include "formats/base/result.h"
#include "formats/volume/label_volume.h"
#include "pipeline/base/progress.h"

namespace sonocase::pipeline::inline exporting {

struct LevelSetExportOptions {
    double sigma_vx = 1;              // smoothing; 0: none, the steps of the voxels stay
    std::vector<std::string> labels;  // names; empty: all but the outside
};

// Writes one FloatGrid of class LEVEL_SET per label, with its name and the metadata "tissue":
// signed distance in mm, negative inside, 3 voxels to either side; world coordinates are the
// volume's frame. Errors: an unknown name, voxels that are not cubic, a file that cannot be
// written.
Status export_level_sets(const LabelVolume& volume,
                         const std::string& path,
                         const LevelSetExportOptions& options = {},
                         const Progress& progress = {});

}  // namespace sonocase::pipeline::inline exporting
