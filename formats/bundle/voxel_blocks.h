// SPDX-License-Identifier: Apache-2.0

// The part of a bundle's volumes that is unpacked on demand: boundary records and echo offsets, in
// blocks of bricks. Labels and all tables are loaded from the start; the pools of the other two are
// valid in a block only once the block has been asked for.
//
// Asking neither allocates nor throws, so that the frame loop may do it, on any thread. A block
// costs about 0.1 ms the first time. A block whose contents are invalid although their checksum is
// right is found when it is asked for: it then holds no surfaces and offsets of 0, and status()
// says so.
//
// If the bundle arrives in segments (stream_bundle_in_parts()), a block that is asked for before
// its bytes have arrived holds surfaces without corrections and offsets of 0, and counts as
// awaited.
#pragma once

#include <array>
#include <atomic>
#include <cstdint>
#include <memory>
#include <vector>

#include "formats/base/arrivals.h"
#include "formats/base/geometry.h"
#include "formats/base/jobs.h"
#include "formats/base/result.h"

namespace sonocase {

namespace detail {
struct BlockParts;
}

class VoxelBlocks {
  public:
    explicit VoxelBlocks(std::unique_ptr<detail::BlockParts> parts);
    ~VoxelBlocks();

    // Unpacks every block for which wanted(lower) is true; lower: the block's first voxel. If two
    // threads want the same blocks, one should go backwards.
    template <class Wanted>
    void ensure_loaded(const Wanted& wanted, bool backwards = false) noexcept {
        if (whole()) return;
        for (std::size_t n = 0; n < count_; ++n) {
            const std::size_t block = backwards ? count_ - 1 - n : n;
            if (is_loaded(block)) continue;
            if (wanted(lower_[block])) unpack(block);
        }
    }
    void ensure_voxel_loaded(int i, int j, int k) noexcept;
    void load_all(JobRunner& jobs);

    int edge() const noexcept { return edge_; }  // of a block, voxels
    bool whole() const noexcept { return left_.load(std::memory_order_acquire) == 0; }
    std::size_t pool_bytes() const noexcept;  // of all blocks, unpacked
    bool damaged() const noexcept { return damaged_.load(std::memory_order_relaxed); }
    Status status() const;

    // For bundles that arrive in segments; on the thread that asks for blocks.
    std::size_t awaited() const noexcept { return awaited_.load(std::memory_order_relaxed); }
    bool is_awaited(std::size_t block) const noexcept {
        return asked_[block].load(std::memory_order_relaxed) != 0;
    }
    void forget_awaited() noexcept;  // awaited() counts from 0 again
    // Call it when segments have arrived: blocks whose bytes are now there are unpacked when they
    // are asked for again.
    void read_arrived() noexcept;
    std::size_t count() const noexcept { return count_; }
    Int3 lower(std::size_t block) const noexcept { return lower_[block]; }  // first voxel
    // Where the block's bytes lie in the file: records, echo offsets.
    std::array<ByteRange, 2> places(std::size_t block) const noexcept;

    // Keeps the system from providing a page of 2 MB for a block of a tenth of that size. Call it
    // before any block is asked for.
    void use_small_pages() noexcept;

  private:
    enum State : std::uint8_t { kPacked, kBeingUnpacked, kFilledIn, kLoaded };
    struct Worker;

    bool is_loaded(std::size_t block) const noexcept {
        return state_[block].load(std::memory_order_acquire) == kLoaded;
    }
    bool take(std::size_t block) noexcept;  // claims it; false if another thread has done so
    void finish(std::size_t block, bool valid) noexcept;
    void unpack(std::size_t block) noexcept;
    void await(std::size_t block) noexcept;

    std::unique_ptr<detail::BlockParts> parts_;
    std::unique_ptr<Worker[]> workers_;  // threads that can unpack at the same time
    Int3 blocks_{0, 0, 0};
    int edge_ = 0;
    std::size_t count_ = 0;
    std::vector<Int3> lower_;  // first voxel of each block
    std::unique_ptr<std::atomic<State>[]> state_;
    std::atomic<std::size_t> left_{0};
    std::unique_ptr<std::atomic<std::uint8_t>[]> asked_;  // before its bytes arrived
    std::atomic<std::size_t> awaited_{0};
    std::atomic<bool> damaged_{false};
};

}  // namespace sonocase
