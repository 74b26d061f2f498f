// SPDX-License-Identifier: Apache-2.0

// The part of a volume that a frame of model `physical` may read, for bundles that are unpacked
// block by block, and a thread that unpacks it ahead of the frames.
#pragma once

#include <atomic>
#include <cmath>
#include <memory>

#include "formats/base/mailbox.h"
#include "formats/bundle/voxel_blocks.h"
#include "formats/volume/label_volume.h"
#include "runtime/imaging/core/host.h"
#include "runtime/imaging/physical/model/physical_tables.h"

namespace sonocase::runtime {

// What a frame may read: a little more than it does read, never less.
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
    // The same in reverse order, for a second thread, which stops before a block once enough() is
    // true.
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
        Vector3 step[3];       // from voxel to voxel along each axis
        double radius_mm = 0;  // of the ball
        double across_mm = 0;  // half extent of the block across the plane
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
    double radius_mm_ = 0, half_extent_ = 0;  // see ScanGeometry
    double deepest_mm_ = 0;                   // along a beam
    double thick_mm_ = 0;                     // to each side of the plane
};

// Unpacks on another thread what a frame reads, together with the frame itself, and then what lies
// around the scan plane, so that the frames of a moving probe seldom have to.
class ReadAhead {
  public:
    // blocks must outlive it.
    ReadAhead(VoxelBlocks& blocks, const Grid& grid, std::unique_ptr<Background> background);
    ~ReadAhead();  // stops and waits
    ReadAhead(const ReadAhead&) = delete;
    ReadAhead& operator=(const ReadAhead&) = delete;

    // Announces what a frame is about to read; it replaces the frame before, finished or not. reach
    // must stay where it is. Neither allocates, throws nor waits for the reading.
    void frame(const ScanReach& reach, const Rigid& volume_from_probe, double shift_mm) noexcept;

  private:
    struct Frame {
        const ScanReach* reach = nullptr;
        Rigid volume_from_probe;
        double shift_mm = 0;
    };
    void read() noexcept;  // on the other thread

    VoxelBlocks& blocks_;
    const Grid grid_;
    Mailbox<Frame> frames_;
    std::atomic<bool> news_{false}, stop_{false};
    const std::unique_ptr<Background> background_;
};

}  // namespace sonocase::runtime
