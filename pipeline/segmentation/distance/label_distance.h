// SPDX-License-Identifier: Apache-2.0

// Signed distance to unions of labels of a map on any grid, smoothed, on nodes fine enough for
// shape interpolation.
//
// Thick slices are interpolated by shape: each slice has its own distance field;
// the obliquity of the surfaces turns it into a distance in space, balls close outlines that end,
// and the slices are blended along their axis by Catmull-Rom cubics. Outlines that move sideways
// are blended along their shift (slice_groups.h). Nearly cubic voxels are measured in 3-D.
//
// The distance is then smoothed by separable kernels without second moment (box_smoothing.h) of
// several widths. The widest is 1.76 sigma, used where it keeps the map's own voxels on their side
// of the surface; it flattens the long steps of surfaces nearly parallel to the grid. Elsewhere
// the width is sigma, then 0.59 sigma, then detail, each where the wider one would move voxels to
// the wrong side (thin structures, edges, vessels), with a smooth transition between widths.
#pragma once

#include <array>
#include <memory>
#include <vector>

#include "formats/volume/label_volume.h"
#include "pipeline/segmentation/distance/box_smoothing.h"
#include "pipeline/segmentation/distance/signed_distance.h"
#include "pipeline/segmentation/distance/slice_groups.h"
#include "pipeline/segmentation/distance/sparse_box.h"

namespace sonocase::pipeline::inline segmentation_distance {

struct LabelDistanceOptions {
    double sigma_vx = 1.7;   // smoothing, in-plane voxels of the map; 0: none
    double detail_vx = 0.5;  // smoothing of structures too fine for any other width
    // How far on the wrong side of the surface a voxel of the map may end; 0 applies where the
    // label is one voxel thick.
    double tolerance_vx = 0.25;
    double wide_tolerance_vx = 0.15;  // of the widest smoothing
    // Smoothing across thick slices, in slices; 0: as in the plane, in mm, but at most 0.3 slices
    // where a slice is 3.5 pixels or more.
    double sigma_slices = 0;
    // Slice spacing, in pixels, from which slices are interpolated by shape.
    double thick_ratio = 1.5;
    bool shape_slices = true;  // false: thick slices are measured in 3-D like any others
    bool follow_shift = true;  // blend outlines that move sideways along their shift
};

class LabelDistance {
  public:
    // `labels` must outlive it.
    LabelDistance(const LabelVolume& labels, const LabelDistanceOptions& options);
    LabelDistance(LabelVolume&&, const LabelDistanceOptions&) = delete;

    const LabelVolume& labels() const { return labels_; }  // slices along k
    const Grid& nodes() const { return nodes_; }           // k refined by factor()
    int factor() const { return factor_; }
    const SliceGroups& groups() const { return groups_; }
    double limit_mm() const { return limit_mm_; }

    // Scratch space of one thread. Kept from call to call: the system clears newly allocated
    // memory, which takes as long as the smoothing does.
    struct Scratch {
        SparseBox raw, smooth, wide, phi, other, marked, weight;
        std::array<SparseBox, 3> part_raw, fine;  // per level
        // For slices that are interpolated.
        std::vector<float> plain, flat, within, first, second;
        std::vector<std::uint8_t> capped;
        void slices_done() {
            for (std::vector<float>* v : {&plain, &flat, &within, &first, &second})
                std::vector<float>().swap(*v);
        }
    };
    // The box of nodes outside which the distance to a union of labels exceeds the limit; empty:
    // the union has no voxels.
    VoxelBox reach(const LabelSet& labels) const;
    // Smooth phi (negative inside, mm) of a union of labels on reach(labels), which is returned;
    // phi: # box.count(). Thread-safe, with one Scratch per thread.
    VoxelBox distance(const LabelSet& labels, std::vector<float>* phi, Scratch* scratch) const;
    // The same on a part of that box alone, in memory that goes with the part and not with the map,
    // and on the needed blocks alone (null: everywhere). Along the axis of slices that are
    // interpolated the part must be as long as reach(labels). Equal to distance() except where
    // structures too fine for the second width end beside the margin of the part: which of them
    // count as strays there depends on where smoothing stops.
    void distance_on(const LabelSet& labels,
                     const VoxelBox& part,
                     const NodeBlocks* needed,
                     SparseBox* phi,
                     Scratch* scratch) const;

  private:
    void shape_interpolated(const LabelSet& labels,
                            const VoxelBox& box,
                            std::vector<float>* phi,
                            Scratch* scratch) const;
    // Slices interpolated by shape. own: the group is of a label of the union; otherwise it is cut
    // out of it.
    void correct_obliquity(const VoxelBox& slices, Scratch* scratch) const;
    void close_end(const SliceGroup& group,
                   bool own,
                   const VoxelBox& slices,
                   std::vector<float>* flat,
                   std::vector<std::uint8_t>* capped) const;
    void blend_slices(const VoxelBox& box,
                      const std::vector<float>& flat,
                      std::vector<float>* phi) const;
    void blend_group(const SliceGroup& group,
                     bool own,
                     const VoxelBox& box,
                     std::vector<float>* phi) const;
    bool touches(const SliceGroup& group, const VoxelBox& box) const;

    std::unique_ptr<LabelVolume> turned_;  // null: the slices are last as they were given
    const LabelVolume& labels_;
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
    // Nodes beside a part, per axis, on which values are needed for those of the part.
    struct Margins {
        Int3 blended, detailed, widened, smoothed, measured;
    };
    Margins margins() const;
    double largest_sigma_nodes(int axis) const;
    void add_level(double sigma_vx, double tolerance_vx);
    // Voxels of the map that phi puts on the wrong side of the surface: indices of their nodes in
    // its box.
    std::vector<std::size_t> find_strays(const LabelSet& labels,
                                         const SparseBox& phi,
                                         double tolerance_vx) const;
    // Replaces phi, which is `raw` smoothed by `level`, by finer levels near its strays.
    void add_detail(const LabelSet& labels,
                    const SparseBox& raw,
                    std::size_t level,
                    SparseBox* phi,
                    Scratch* scratch) const;
    // Replaces phi by `fine`, given on a part of its box, near the strays, with a smooth
    // transition; on the needed blocks, null: everywhere.
    void blend(const BoxKernels& spread,
               const std::vector<std::size_t>& strays,
               const SparseBox& fine,
               const NodeBlocks* needed,
               SparseBox* phi,
               Scratch* scratch) const;

    std::vector<Level> levels_;  // coarse to fine
    Level wide_;                 // after levels_[0]
};

// The same voxels with the axis of the largest spacing last.
LabelVolume slices_last(const LabelVolume& labels);

}  // namespace sonocase::pipeline::inline segmentation_distance
