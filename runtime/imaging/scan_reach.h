// The part of a volume that a frame of model `physical` may read, so that a bundle which is unpacked
// as it is needed has it ready. A little more than is read, never less.
#pragma once

#include "formats/grid.h"
#include "formats/voxel_blocks.h"
#include "runtime/imaging/physical_model.h"

namespace sonocase::runtime {

class ScanReach {
  public:
    ScanReach() = default;
    ScanReach(const ScanGeometry& geometry, const physical::Tables& tables, double voxel_mm);

    // shift_mm: how far the anatomy may have moved. Neither allocates nor throws.
    void unpack(VoxelBlocks& blocks,
                const Grid& grid,
                const Rigid& volume_from_probe,
                double shift_mm) const noexcept;

  private:
    // Whether what lies in a ball may be reached, across_mm of it across the plane; its centre is in
    // the probe's frame.
    bool reaches(Point3 centre, double radius_mm, double across_mm) const noexcept;

    bool fan_ = false;
    double radius_mm_ = 0, half_extent_ = 0;  // of the face: ScanGeometry
    double deepest_mm_ = 0;                   // along a beam
    double thick_mm_ = 0;                     // to each side of the plane
};

}  // namespace sonocase::runtime
