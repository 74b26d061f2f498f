// SPDX-License-Identifier: Apache-2.0

// Unpacks, beside the frames, what a frame reads, together with the frame itself, and then what
// lies around the scan plane, so that the frames of a moving probe seldom have to.
#pragma once

#include <atomic>
#include <memory>

#include "formats/base/mailbox.h"
#include "formats/bundle/voxel_blocks.h"
#include "formats/volume/grid.h"
#include "runtime/imaging/host/background.h"
#include "runtime/imaging/physical/model/scan_reach.h"

namespace sonocase::runtime {

class ReadAhead {
  public:
    // blocks must outlive it.
    ReadAhead(VoxelBlocks& blocks, const Grid& grid, std::unique_ptr<Background> background);
    ~ReadAhead();  // stops and waits
    ReadAhead(const ReadAhead&) = delete;
    ReadAhead& operator=(const ReadAhead&) = delete;

    // Announces what a frame is about to read; takes the place of the frame before, finished or
    // not. reach must stay where it is. Neither allocates, throws nor waits for the reading.
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
