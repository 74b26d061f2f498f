// The part of a volume that a frame of model `physical` may read, so that a bundle which is unpacked
// as it is needed has it ready. A little more than is read, never less.
#pragma once

#include "formats/grid.h"
#include "runtime/imaging/physical_model.h"

namespace sonocase::runtime {

class ScanReach {
  public:
    ScanReach() = default;
    ScanReach(const ScanGeometry& geometry, const physical::Tables& tables, double voxel_mm);

    // Asks for what a frame reads. blocks: VoxelBlocks or BrickWords. shift_mm: how far the anatomy
    // may have moved. Neither allocates nor throws.
    template <class Blocks>
    void need(Blocks& blocks,
              const Grid& grid,
              const Rigid& volume_from_probe,
              double shift_mm) const noexcept {
        need(blocks, grid, volume_from_probe, shift_mm, [] { return false; });
    }
    // enough(): true ends it before a block.
    template <class Blocks, class Enough>
    void need(Blocks& blocks,
              const Grid& grid,
              const Rigid& volume_from_probe,
              double shift_mm,
              const Enough& enough) const noexcept {
        const Rigid probe_from_volume = inverse(volume_from_probe);
        blocks.need([&](Int3 lower, Int3 upper) {
            return !enough() && reaches(grid, lower, upper, probe_from_volume, shift_mm);
        });
    }

  private:
    bool reaches(const Grid& grid,
                 Int3 lower,
                 Int3 upper,
                 const Rigid& probe_from_volume,
                 double shift_mm) const noexcept;
    // Whether what lies in a ball may be reached, across_mm of it across the plane; its centre is in
    // the probe's frame.
    bool reaches(Point3 centre, double radius_mm, double across_mm) const noexcept;

    bool fan_ = false;
    double radius_mm_ = 0, half_extent_ = 0;  // of the face: ScanGeometry
    double deepest_mm_ = 0;                   // along a beam
    double thick_mm_ = 0;                     // to each side of the plane
};

}  // namespace sonocase::runtime
