// SPDX-License-Identifier: Apache-2.0

// Unpacks on a thread of its own what a frame reads, together with the frame itself, and then what
// lies round the scan plane, so that the frames of a probe that moves seldom have to.
#pragma once

#include <atomic>
#include <condition_variable>
#include <mutex>
#include <thread>

#include "formats/bundle/voxel_blocks.h"
#include "formats/volume/grid.h"
#include "runtime/imaging/physical/model/scan_reach.h"

namespace sonocase::runtime {

class ReadAhead {
  public:
    // blocks must outlive it. Where no thread is to be had, nothing is read ahead.
    ReadAhead(VoxelBlocks& blocks, const Grid& grid);
    ~ReadAhead();  // stops
    ReadAhead(const ReadAhead&) = delete;
    ReadAhead& operator=(const ReadAhead&) = delete;

    // What a frame is about to ask for; the one before it is left for it. reach must stay where it
    // is. Neither allocates nor throws, and does not wait for what is read.
    void frame(const ScanReach& reach, const Rigid& volume_from_probe, double shift_mm) noexcept;

  private:
    void run() noexcept;

    VoxelBlocks& blocks_;
    const Grid grid_;
    std::mutex mutex_;
    std::condition_variable wake_;
    const ScanReach* reach_ = nullptr;  // under mutex_, as the pose
    Rigid volume_from_probe_;
    double shift_mm_ = 0;
    std::atomic<bool> news_{false}, stop_{false};
    std::thread thread_;
};

}  // namespace sonocase::runtime
