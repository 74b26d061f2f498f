// SPDX-License-Identifier: Apache-2.0

// Shapes that follow the anatomy: pools of fluid, swelling, tubes. Each gives a rank that rises
// from what fills first; see pathology.h.
#pragma once

#include <memory>
#include <vector>

#include "pipeline/pathology/label_canvas.h"
#include "pipeline/segmentation/distance/signed_distance.h"

namespace sonocase::pipeline {

// Trilinear between the samples of a box at `voxel`; `beyond` outside the box.
double sampled_at(const VoxelBox& box,
                  const std::vector<float>& values,
                  Vector3 voxel,
                  double beyond);

// A signed distance in a box of voxels, trilinear; `beyond` outside the box. Cheap to copy.
VoxelField sampled_field(const VoxelBox& box, std::vector<float> values, double beyond);

// The range of voxels that these labels take up, grown by `voxels` and cut to the grid.
VoxelRange range_of(const LabelVolume& volume, const Labels& labels, int voxels);
VoxelBox box_of(const VoxelRange& range);

// Height against gravity, in voxels: `down` is a unit vector.
VoxelField height_rank(Vector3 down);
// Signed distance to the labels, voxels, up to limit_mm.
VoxelField distance_to_labels(const LabelVolume& volume,
                              const Labels& labels,
                              const VoxelRange& range,
                              double limit_mm);
// Distance to a path of straight pieces, voxels.
VoxelField path_rank(std::vector<Vector3> path_vx);
// The greater of two signed distances: both shapes at once.
VoxelField intersection(VoxelField a, VoxelField b);
VoxelField ball(Vector3 centre_vx, double radius_vx);

// The direction in which the voxels of these labels extend most, near a point (unit).
Vector3 long_axis(const LabelCanvas& canvas,
                  const Labels& labels,
                  Vector3 near_vx,
                  double radius_vx);

}  // namespace sonocase::pipeline
