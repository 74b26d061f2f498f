// SPDX-License-Identifier: Apache-2.0

// The part of a volume that a frame of model `physical` may read, for bundles that are unpacked
// block by block. A little more than is read, never less.
#pragma once

#include <cmath>

#include "formats/bundle/voxel_blocks.h"
#include "formats/volume/grid.h"
#include "runtime/imaging/physical/model/physical_tables.h"

namespace sonocase::runtime {

class ScanReach {
  public:
    ScanReach() = default;
    ScanReach(const ScanGeometry& geometry, const physical::Tables& tables, double voxel_mm);

    // Loads what a frame reads. blocks: VoxelBlocks or BrickTable. shift_mm: how far the anatomy
    // may have moved. Neither allocates nor throws.
    template <class Blocks>
    void ensure_loaded(Blocks& blocks,
                       const Grid& grid,
                       const Rigid& volume_from_probe,
                       double shift_mm) const noexcept {
        const View view = seen(grid, blocks.edge(), volume_from_probe, shift_mm);
        blocks.ensure_loaded([&](Int3 lower) { return reaches(view, lower); });
    }
    // The same in reverse order, for a second thread; enough() is asked before each block and ends
    // it.
    template <class Enough>
    void ensure_loaded_backwards(VoxelBlocks& blocks,
                                 const Grid& grid,
                                 const Rigid& volume_from_probe,
                                 double shift_mm,
                                 const Enough& enough) const noexcept {
        const View view = seen(grid, blocks.edge(), volume_from_probe, shift_mm);
        blocks.ensure_loaded([&](Int3 lower) { return reaches(view, lower) && !enough(); }, true);
    }

  private:
    // Blocks in the probe's frame: a ball around the middle of each.
    struct View {
        Point3 first;  // middle of the block that begins at voxel (0, 0, 0), in the probe's frame
        Vector3 step[3];  // of a voxel
        double radius_mm = 0;
        double across_mm = 0;  // of the block, across the plane
    };
    View seen(const Grid& grid, int edge, const Rigid& volume_from_probe, double shift_mm) const;
    bool reaches(const View& view, Int3 lower) const noexcept {
        // A frame asks about thousands of blocks, and most lie beside the plane.
        const double y = view.first.y + lower.x * view.step[0].y + lower.y * view.step[1].y +
                         lower.z * view.step[2].y;
        if (std::abs(y) > thick_mm_ + view.across_mm) return false;
        return reaches_along(view, lower);
    }
    bool reaches_along(const View& view, Int3 lower) const noexcept;  // in the plane

    bool fan_ = false;
    double radius_mm_ = 0, half_extent_ = 0;  // of the face: ScanGeometry
    double deepest_mm_ = 0;                   // along a beam
    double thick_mm_ = 0;                     // to each side of the plane
};

}  // namespace sonocase::runtime
