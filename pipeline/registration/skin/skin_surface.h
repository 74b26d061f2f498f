// SPDX-License-Identifier: Apache-2.0

// The patient's skin, from the label map: sub-voxel points with outward normals and triangles.
//
// The body (every label except outside) is averaged onto a grid of about working_mm, cleaned,
// smoothed by a Gaussian and contoured at one half. What is not skin is left out and counted: faces
// where the field of view cuts the body (at the grid's faces, at a plane inside a padded grid, or
// on the circle of a round field of view), remnants of the table, and arms. Cost: one pass over the
// labels, then 0.1 s for a torso at 3 mm.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "formats/base/result.h"
#include "formats/base/stage_report.h"
#include "formats/volume/label_volume.h"
#include "formats/volume/surface.h"

namespace sonocase::pipeline::inline registration_skin {

struct SkinSurfaceOptions {
    double working_mm = 3.0;    // voxels are averaged up to about this, > 0
    double smoothing_mm = 2.5;  // standard deviation of the Gaussian, >= 0
    double bridge_mm = 12.0;    // thinner sheets and bridges are not body
    double min_part = 0.35;     // of a slice's largest part: smaller parts are arms or remnants
};

struct SkinSurfaceResult {
    Surface skin;                      // `ct` frame; open where the body is cut
    std::vector<std::uint8_t> on_rim;  // # points: 1 on an open edge, where the real skin continues
    Box3 box;                          // of the label map, to the outer faces of its voxels
    StageReport report;                // stage "surface"
};

// Errors: a map without a body, or one that is all body.
Result<SkinSurfaceResult> extract_skin_surface(const LabelVolume& labels,
                                               const SkinSurfaceOptions& options = {});

}  // namespace sonocase::pipeline::inline registration_skin
