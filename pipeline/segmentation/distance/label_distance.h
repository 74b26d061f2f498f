// SPDX-License-Identifier: Apache-2.0

// Signed distance to unions of labels of a map on any grid, made smooth, on nodes fine enough for
// both.
//
// Thick slices are interpolated by shape (slice_shapes.cpp): a distance field a slice, made a
// distance in space by the lean of its surfaces, closed by balls where outlines end, blended along
// the slice axis with Catmull-Rom's cubic; outlines that move sideways are blended along their
// shift (slice_groups.h). Nearly cubic voxels are measured in 3-D. Then separable smoothing by a
// kernel without second moment (box_smoothing.h), at several widths: 1.76 sigma where that leaves
// the map's own voxels on their side of the surface, which flattens the long steps of surfaces that
// lie nearly along the grid; sigma where it would not; 0.59 sigma and then detail where that would
// not either (thin structures, edges, vessels), with a smooth passage between them.
#pragma once

#include <array>
#include <vector>

#include "formats/volume/label_volume.h"
#include "pipeline/segmentation/distance/box_smoothing.h"
#include "pipeline/segmentation/distance/signed_distance.h"
#include "pipeline/segmentation/distance/slice_groups.h"

namespace sonocase::pipeline {

struct LabelDistanceOptions {
    double sigma_vx = 1.7;       // smoothing, in-plane voxels of the map; 0: none
    double detail_vx = 0.5;      // smoothing of what is too fine for any other width
    double tolerance_vx = 0.25;  // how far across they may come to lie; what is one voxel thick not
    double wide_tolerance_vx = 0.15;  // for the widest
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

    // Scratch space of one thread: the system clears what is allocated anew, which takes as long as
    // the smoothing does.
    struct Scratch {
        std::vector<float> smooth, wide, other, weight;
        std::array<std::vector<float>, 3> raw, fine;  // of the levels
        std::vector<float> flat, within;              // of slices
        std::vector<std::uint8_t> capped;
    };
    // Smooth phi (negative inside, mm) of a union of labels on `box` of the nodes; # box.count().
    // Outside `box` it is further than the limit. Thread-safe, a Scratch a thread.
    VoxelBox distance(const LabelSet& labels, std::vector<float>* phi, Scratch* scratch) const;

  private:
    void shape_interpolated(const LabelSet& labels,
                            const VoxelBox& box,
                            std::vector<float>* phi,
                            Scratch* work) const;
    void lean(const VoxelBox& slices, Scratch* scratch) const;
    void cap(const SliceGroup& group,
             bool own,
             const VoxelBox& slices,
             std::vector<float>* flat,
             std::vector<std::uint8_t>* capped) const;
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

    struct Level {
        BoxKernels kernels, spread;
        double tolerance_vx = 0;
    };
    bool thick(int axis) const { return axis == 2 && factor_ > 1; }
    double nodes_per_vx(int axis) const;
    double most_nodes(int axis) const;
    void add_level(double sigma_vx, double tolerance_vx);
    // Nodes of the map's own voxels that phi puts on the wrong side; indices in `box`.
    std::vector<std::size_t> find_strays(const LabelSet& labels,
                                         const VoxelBox& box,
                                         const std::vector<float>& phi,
                                         double tolerance_vx) const;
    // phi, smoothed by `level`, is replaced by finer levels where it has strays.
    void add_detail(const LabelSet& labels,
                    const VoxelBox& box,
                    const std::vector<float>& raw,
                    std::size_t level,
                    std::vector<float>* phi,
                    Scratch* work) const;
    // phi on `box` becomes `fine` on `part` of it near the strays, with a smooth passage.
    void blend(const VoxelBox& box,
               const BoxKernels& spread,
               const std::vector<std::size_t>& strays,
               const VoxelBox& part,
               const std::vector<float>& fine,
               std::vector<float>* phi,
               Scratch* work) const;

    std::vector<Level> levels_;  // coarse to fine
    Level wide_;                 // after levels_[0]
};

// The same voxels with the axis of the largest spacing last.
LabelVolume slices_last(const LabelVolume& labels);

}  // namespace sonocase::pipeline
