// Before and after in three planes: what resampling and smoothing did, for people.
#pragma once

#include <cstdint>
#include <string>

#include "formats/brick_volume.h"
#include "formats/label_volume.h"
#include "formats/registration.h"
#include "formats/result.h"

namespace sonocase::pipeline {

struct SegmentationPictureInput {
    const LabelVolume& before;                   // in `ct`, or already on the grid of `after`
    const Registration* registration;            // null: both are in one frame
    const LabelVolume& after;                    // cubic voxels
    const BrickVolume<std::uint32_t>& boundary;  // of after; may be empty
};

// Label as a renderer draws it at a voxel-coordinate point: nearest voxel, then its boundary plane.
int label_with_boundary(const LabelVolume& volume,
                        const BrickVolume<std::uint32_t>& boundary,
                        double x,
                        double y,
                        double z);

// Writes whole-xy.png, whole-xz.png, whole-yz.png (axes of `after`, through the middle of the body)
// and close-up-xy.png and so on (40 mm about the place with the most labels): left before, middle
// after as voxels, right after with boundary planes. Makes the folder.
Status write_segmentation_pictures(const SegmentationPictureInput& input,
                                   const std::string& folder);

}  // namespace sonocase::pipeline
