// Unpacks the part of a bundle that lies round the scan plane on a thread of its own, so that the
// frames of a probe that moves seldom have to.
#pragma once

#include <atomic>
#include <condition_variable>
#include <mutex>
#include <thread>

#include "formats/grid.h"
#include "formats/voxel_blocks.h"
#include "runtime/imaging/scan_reach.h"

namespace sonocase::runtime {

class ReadAhead {
  public:
    // blocks must outlive it. Where no thread is to be had, nothing is read ahead.
    ReadAhead(VoxelBlocks& blocks, const Grid& grid);
    ~ReadAhead();  // stops
    ReadAhead(const ReadAhead&) = delete;
    ReadAhead& operator=(const ReadAhead&) = delete;

    // What a frame has just shown; one that is still being read round is left for it. reach must stay
    // where it is. Neither allocates nor throws, and does not wait for what is read.
    void round(const ScanReach& reach, const Rigid& volume_from_probe) noexcept;

  private:
    void run() noexcept;

    VoxelBlocks& blocks_;
    const Grid grid_;
    std::mutex mutex_;
    std::condition_variable wake_;
    const ScanReach* reach_ = nullptr;  // under mutex_, as the pose
    Rigid volume_from_probe_;
    std::atomic<bool> news_{false}, stop_{false};
    std::thread thread_;
};

}  // namespace sonocase::runtime
