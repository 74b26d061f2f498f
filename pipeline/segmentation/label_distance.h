// Signed distance to every label of a map on any grid, made smooth, on nodes fine enough for both.
//
// Thick slices are interpolated by shape: a distance field a slice, blended along the slice axis
// with Catmull-Rom's cubic, outlines that move sideways blended along their shift (slice_groups.h).
// Nearly cubic voxels are measured in 3-D. Then one separable smoothing by a kernel without second
// moment, K = a G - (a - 1) G * G with a = 2 + 1 / (3 sigma^2): planes stay planes, and a sphere of
// radius R moves by O(sigma^4 / R^3) instead of O(sigma^2 / R) (the 1/3 answers for the cubic
// B-spline that the nodes are later read with). It is done at two widths: sigma where the map's own
// voxels stay on their side of the surface (within a tolerance: steps and noise), detail where
// they would not (thin structures, edges, vessels), with a smooth passage between them.
#pragma once

#include <vector>

#include "formats/label_volume.h"
#include "pipeline/segmentation/signed_distance.h"
#include "pipeline/segmentation/slice_groups.h"

namespace sonocase::pipeline {

struct LabelDistanceOptions {
    double sigma_vx = 1.7;       // smoothing, in-plane voxels of the map; 0: none
    double detail_vx = 0.5;      // smoothing where sigma_vx would carry voxels across the surface
    double tolerance_vx = 0.25;  // how far across they may come to lie; what is one voxel thick not
    double sigma_slices = 0;  // smoothing along thick slices, in slices; 0: as in the plane, in mm,
                              // but at most 0.3 slices of 3.5 pixels and more
    double thick_ratio =
        1.5;  // slice spacing over pixel from which slices are interpolated by shape
    bool shape_slices = true;  // false: thick slices are measured in 3-D like any others
    bool follow_shift = true;  // blend outlines that move sideways along their shift
};

class LabelDistance {
  public:
    LabelDistance(const LabelVolume& labels, const LabelDistanceOptions& options);

    const LabelVolume& labels() const { return labels_; }  // slices along k
    const Grid& nodes() const { return nodes_; }           // k refined by factor()
    int factor() const { return factor_; }
    const SliceGroups& groups() const { return groups_; }
    double limit_mm() const { return limit_mm_; }

    // Smooth phi (negative inside, mm) of one label on `box` of the nodes; # box.count().
    // Outside `box` the label is further than the limit. Thread-safe.
    VoxelBox distance(std::uint8_t label, std::vector<float>* phi) const;

  private:
    void shape_interpolated(std::uint8_t label, const VoxelBox& box, std::vector<float>* phi) const;
    // own: the group is of the label of phi; else it is carved out of it.
    void blend_group(const SliceGroup& group,
                     bool own,
                     const VoxelBox& box,
                     std::vector<float>* phi) const;

    LabelVolume labels_;
    LabelDistanceOptions options_;
    Grid nodes_;
    int factor_ = 1;
    double limit_mm_ = 0;
    std::vector<VoxelBox> boxes_;
    SliceGroups groups_;
    // Where the surface of `smooth` leaves voxels on the wrong side, `phi` is taken instead.
    void keep_detail(std::uint8_t label,
                     const VoxelBox& box,
                     const std::vector<float>& smooth,
                     std::vector<float>* phi) const;

    struct Kernels {
        std::vector<float> axis[3];
    };
    Kernels wide_, fine_, spread_;
};

// The same voxels with the axis of the largest spacing last.
LabelVolume slices_last(const LabelVolume& labels);

}  // namespace sonocase::pipeline
