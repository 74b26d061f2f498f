// SPDX-License-Identifier: Apache-2.0

// Pictures for people of what resampling and smoothing did: before, after and what changed, in
// three planes.
#pragma once

#include <cstdint>
#include <string>

#include "formats/base/result.h"
#include "formats/volume/brick_volume.h"
#include "formats/volume/label_volume.h"
#include "pipeline/registration/map/registration.h"

namespace sonocase::pipeline::inline exporting {

struct SegmentationPictureInput {
    const LabelVolume& before;         // in the frame of the CT, or already on the grid of `after`
    const Registration* registration;  // null: both are in one frame
    const LabelVolume& after;          // cubic voxels
    const BrickVolume<std::uint32_t>& boundary;  // of after; may be empty
};

// The label that a renderer draws at a point in voxel coordinates: nearest voxel, then its boundary
// plane.
int label_with_boundary(const LabelVolume& volume,
                        const BrickVolume<std::uint32_t>& boundary,
                        double x,
                        double y,
                        double z);

// Whether a voxel of `label` is within reach_vx of a point; everything beyond the volume is
// outside.
bool label_is_within(const LabelVolume& volume, int label, double reach_vx, Point3 voxel);

// Writes whole-xy.png, whole-xz.png, whole-yz.png (axes of `after`, through the middle of the body)
// and close-up-xy.png and so on (40 mm about the place with the most labels). Four panels from
// left: before; after as voxels; after with boundary planes; and on grey what changed: ochre where
// a label was replaced by a neighbour, as when steps are smoothed, red where the label before is
// farther away than half a voxel of either volume. Creates the folder.
Status write_segmentation_pictures(const SegmentationPictureInput& input,
                                   const std::string& folder);

}  // namespace sonocase::pipeline::inline exporting
