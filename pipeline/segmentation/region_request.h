// SPDX-License-Identifier: Apache-2.0

// A box of a case that is cooked on smaller voxels as well: [[region]] of a recipe.
#pragma once

#include <optional>
#include <string>

#include "formats/base/result.h"
#include "formats/registration/registration.h"
#include "formats/volume/fine_region.h"
#include "formats/volume/label_volume.h"

namespace sonocase::pipeline {

inline constexpr double kMostRegionVoxels = 2e8;

struct RegionRequest {
    std::string name = "region";
    double voxel_mm = 0.3;  // [0.1, 2], below that of the case
    // The box: of size_mm about the centre, or round a label.
    std::optional<Point3> centre;
    bool in_ct = false;  // the centre; it then goes through the map. The box is along `mannequin`
    Vector3 size_mm{0, 0, 0};
    std::string label;      // empty: the centre
    double margin_mm = 10;  // round the label
    std::string target;     // of an exercise; the reader of recipes puts its centre in
};

// Round the voxels' centres of a label of the palette, and margin_mm farther; in the volume's
// frame. Empty: it has none. Cost: one pass over the voxels.
Box3 box_of_label(const LabelVolume& volume, const std::string& label, double margin_mm);

// The box in `mannequin`, cut off at the cooked volume. Errors: a label that the volume lacks, a
// box beyond the volume, voxels not below the case's, more than 2e8 voxels.
Result<Box3> region_box(const RegionRequest& request,
                        const LabelVolume& cooked,
                        const Registration& registration);

}  // namespace sonocase::pipeline
