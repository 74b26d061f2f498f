// SPDX-License-Identifier: Apache-2.0

// The grid of cubic voxels that a registered label map is resampled into.
#pragma once

#include <optional>
#include <string>

#include "formats/base/result.h"
#include "formats/volume/fine_region.h"
#include "formats/volume/label_volume.h"
#include "pipeline/registration/map/registration.h"

namespace sonocase::pipeline::inline segmentation {

struct CookedGridOptions {
    double voxel_mm = 1;   // edge of the cubic voxels, [0.2, 10]
    double margin_mm = 4;  // air kept around the body, [0, 1000]
};

// Axes of `mannequin` (direction is the identity), origin at a whole multiple of voxel_mm, just
// large enough for the warped image of every voxel with a label other than outside, plus the
// margin. Error: options out of range, a map without a body, or more than 2^31 voxels.
Result<Grid> cooked_grid(const LabelVolume& ct_labels,
                         const Registration& registration,
                         const CookedGridOptions& options = {});

// The registration with ct_box grown by half a voxel on each side: the fit usually proves the map
// on a box that ends at the centres of the CT's outermost voxels, which themselves reach further.
Registration with_voxel_rim(const Registration& registration, const Grid& ct_grid);

// A box of a case that is cooked on smaller voxels as well: [[region]] of a recipe.

inline constexpr double kMaxRegionVoxels = 2e8;

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

// The box round the centres of the voxels of a label, margin_mm larger on each side; in the frame
// of the volume. Empty if the label has no voxel. Cost: one pass over the voxels.
Box3 box_of_label(const LabelVolume& volume, const std::string& label, double margin_mm);

// The box in `mannequin`, cut off at the cooked volume. Errors: a label that the volume lacks, a
// box beyond the volume, voxels not below the case's, more than 2e8 voxels.
Result<Box3> region_box(const RegionRequest& request,
                        const LabelVolume& cooked,
                        const Registration& registration);

}  // namespace sonocase::pipeline::inline segmentation
