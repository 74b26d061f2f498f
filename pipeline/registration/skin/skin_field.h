// SPDX-License-Identifier: Apache-2.0

// The body as a smooth field on a coarse grid, without what is not trunk. The part of the skin
// surface that uses no third-party library.
#pragma once

#include <vector>

#include "formats/base/result.h"
#include "formats/volume/label_volume.h"
#include "pipeline/registration/skin/skin_surface.h"

namespace sonocase::pipeline::inline registration_skin {

struct SkinField {
    Grid grid;  // working grid; where the body is cut by a plane, cropped to the plane
    std::vector<float> inside;  // smoothed; 1/2 at the skin
    double round_view_mm = 0;   // radius of a round field of view that cuts the body; 0: none
    Point3 round_view_centre;   // its axis runs along the grid's k axis through this point

    // Voxels of the working grid at the surface of what was left out, and at cuts.
    long cut_voxels = 0;    // of the body at a face of the field of view
    long table_voxels = 0;  // of sheets and fragments
    long arm_voxels = 0;    // of parts beside the trunk
    double body_ml = 0;
    double hollow = 0;  // share of the body that carried no label and was filled
};

// Errors: a map too small, without a body, or that is body everywhere.
Result<SkinField> make_skin_field(const LabelVolume& labels, const SkinSurfaceOptions& options);

}  // namespace sonocase::pipeline::inline registration_skin
