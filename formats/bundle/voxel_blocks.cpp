// SPDX-License-Identifier: Apache-2.0

#include "formats/bundle/voxel_blocks.h"

#include <algorithm>
#include <mutex>

#ifdef __linux__
#include <sys/mman.h>
#endif

#include "formats/bundle/codec/packed_blocks.h"

namespace sonocase {
namespace {

constexpr std::size_t kWorkers = 2;  // the frame's thread and one that reads ahead of it

}  // namespace

struct VoxelBlocks::Worker {
    std::mutex mutex;
    std::unique_ptr<detail::BlockUnpacker> unpacker;
};

VoxelBlocks::VoxelBlocks(std::unique_ptr<detail::BlockParts> parts)
    : parts_(std::move(parts)),
      workers_(std::make_unique<Worker[]>(kWorkers)),
      blocks_(parts_->grid.blocks()),
      edge_(kBrickEdge * parts_->grid.edge),
      count_(parts_->grid.count()),
      lower_(count_),
      state_(std::make_unique<std::atomic<State>[]>(count_)),
      left_(count_),
      asked_(std::make_unique<std::atomic<std::uint8_t>[]>(count_)) {
    for (std::size_t n = 0; n < kWorkers; ++n)
        workers_[n].unpacker = std::make_unique<detail::BlockUnpacker>(*parts_);
    for (std::size_t block = 0; block < count_; ++block) {
        const Int3 brick = parts_->grid.first_brick(block);
        lower_[block] = {kBrickEdge * brick.x, kBrickEdge * brick.y, kBrickEdge * brick.z};
    }
}

VoxelBlocks::~VoxelBlocks() = default;

void VoxelBlocks::ensure_voxel_loaded(int i, int j, int k) noexcept {
    if (whole()) return;
    const std::size_t block =
        static_cast<std::size_t>(i / edge_) +
        static_cast<std::size_t>(blocks_.x) *
            (static_cast<std::size_t>(j / edge_) +
             static_cast<std::size_t>(blocks_.y) * static_cast<std::size_t>(k / edge_));
    if (!is_loaded(block)) unpack(block);
}

bool VoxelBlocks::take(std::size_t block) noexcept {
    State packed = kPacked;
    return state_[block].compare_exchange_strong(packed, kBeingUnpacked);
}

void VoxelBlocks::finish(std::size_t block, bool valid) noexcept {
    if (!valid) damaged_ = true;
    state_[block].store(kLoaded, std::memory_order_release);
    state_[block].notify_all();
    left_.fetch_sub(1, std::memory_order_release);
}

void VoxelBlocks::await(std::size_t block) noexcept {
    if (asked_[block].exchange(1, std::memory_order_relaxed) == 0)
        awaited_.fetch_add(1, std::memory_order_relaxed);
}

void VoxelBlocks::forget_awaited() noexcept {
    if (awaited() == 0) return;
    for (std::size_t block = 0; block < count_; ++block)
        asked_[block].store(0, std::memory_order_relaxed);
    awaited_ = 0;
}

void VoxelBlocks::read_arrived() noexcept {
    for (std::size_t block = 0; block < count_; ++block) {
        State filled_in = kFilledIn;
        if (parts_->is_loaded(block)) state_[block].compare_exchange_strong(filled_in, kPacked);
    }
}

std::array<ByteRange, 2> VoxelBlocks::places(std::size_t block) const noexcept {
    return {parts_->corrections ? parts_->corrections->place(block) : ByteRange{},
            parts_->offsets ? parts_->offsets->place(block) : ByteRange{}};
}

void VoxelBlocks::unpack(std::size_t block) noexcept {
    if (!take(block)) {
        state_[block].wait(kBeingUnpacked, std::memory_order_acquire);
        if (state_[block].load(std::memory_order_relaxed) == kFilledIn) await(block);
        return;
    }
    for (std::size_t n = 0;; n = (n + 1) % kWorkers) {
        std::unique_lock lock(workers_[n].mutex, std::defer_lock);
        if (n + 1 == kWorkers) {
            lock.lock();
        } else if (!lock.try_lock()) {
            continue;
        }
        if (parts_->is_loaded(block)) {
            finish(block, workers_[n].unpacker->unpack(*parts_, block));
            return;
        }
        workers_[n].unpacker->fill_in(*parts_, block);
        state_[block].store(kFilledIn, std::memory_order_release);
        state_[block].notify_all();
        await(block);
        return;
    }
}

void VoxelBlocks::load_all(JobRunner& jobs) {
    // One job per row of blocks, so that few unpackers are allocated.
    const auto row = static_cast<std::size_t>(std::max(blocks_.x, 1));
    jobs.run((count_ + row - 1) / row, [&](std::size_t job) {
        detail::BlockUnpacker unpacker(*parts_);
        for (std::size_t block = job * row; block < std::min((job + 1) * row, count_); ++block) {
            if (parts_->is_loaded(block) && take(block))
                finish(block, unpacker.unpack(*parts_, block));
        }
    });
    for (std::size_t block = 0; block < count_; ++block)  // those that other threads have begun
        state_[block].wait(kBeingUnpacked, std::memory_order_acquire);
}

void VoxelBlocks::use_small_pages() noexcept {
#ifdef __linux__
    const auto advise = [](auto pool) {
        constexpr std::size_t kPage = 4096;
        const std::size_t skip = (0 - reinterpret_cast<std::uintptr_t>(pool.data())) % kPage;
        const std::size_t bytes = pool.size_bytes();
        if (bytes < skip + kPage) return;
        // Fails on a system without such pages, which is harmless.
        (void)madvise(reinterpret_cast<std::uint8_t*>(pool.data()) + skip,
                      (bytes - skip) / kPage * kPage, MADV_NOHUGEPAGE);
    };
    advise(parts_->boundary.pool);
    advise(parts_->echo.pool);
#endif
}

std::size_t VoxelBlocks::pool_bytes() const noexcept {
    return parts_->boundary.pool.size_bytes() + parts_->echo.pool.size_bytes();
}

Status VoxelBlocks::status() const {
    if (!damaged()) return Done{};
    return Error{"a block of boundary records or echo offsets is invalid", parts_->where,
                 "make the file again"};
}

}  // namespace sonocase
