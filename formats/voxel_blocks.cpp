#include "formats/voxel_blocks.h"

#ifdef __linux__
#include <sys/mman.h>
#endif

#include "formats/detail/block_parts.h"
#include "formats/detail/run_jobs.h"

namespace sonocase {

VoxelBlocks::VoxelBlocks(std::unique_ptr<detail::BlockParts> parts)
    : parts_(std::move(parts)),
      work_(std::make_unique<detail::BlockWork>(*parts_)),
      blocks_(parts_->grid.blocks()),
      edge_(kBrickEdge * parts_->grid.edge),
      count_(parts_->grid.count()),
      there_(std::make_unique<std::atomic<bool>[]>(count_)),
      left_(count_) {}

VoxelBlocks::~VoxelBlocks() = default;

void VoxelBlocks::need_voxel(int i, int j, int k) noexcept {
    if (whole()) return;
    const std::size_t block =
        static_cast<std::size_t>(i / edge_) +
        static_cast<std::size_t>(blocks_.x) *
            (static_cast<std::size_t>(j / edge_) +
             static_cast<std::size_t>(blocks_.y) * static_cast<std::size_t>(k / edge_));
    if (!there(block)) unpack(block);
}

void VoxelBlocks::unpack(std::size_t block) noexcept {
    const std::scoped_lock lock(mutex_);
    if (there(block)) return;
    if (!work_->unpack(*parts_, block)) damaged_ = true;
    there_[block].store(true, std::memory_order_release);
    left_.fetch_sub(1, std::memory_order_release);
}

void VoxelBlocks::need_all(int threads) {
    const std::scoped_lock lock(mutex_);
    // A row of blocks a job, so that few have to find memory to work in.
    const auto row = static_cast<std::size_t>(std::max(parts_->grid.blocks().x, 1));
    detail::run_jobs((count_ + row - 1) / row, threads, [&](std::size_t job) {
        detail::BlockWork work(*parts_);
        for (std::size_t block = job * row; block < std::min((job + 1) * row, count_); ++block) {
            if (there(block)) continue;
            if (!work.unpack(*parts_, block)) damaged_ = true;
            there_[block].store(true, std::memory_order_release);
            left_.fetch_sub(1, std::memory_order_release);
        }
    });
}

void VoxelBlocks::use_small_pages() noexcept {
#ifdef __linux__
    const auto advise = [](auto pool) {
        constexpr std::size_t kPage = 4096;
        const std::size_t skip = (0 - reinterpret_cast<std::uintptr_t>(pool.data())) % kPage;
        const std::size_t bytes = pool.size_bytes();
        if (bytes < skip + kPage) return;
        // A system without such pages says no, and nothing is lost.
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
    return Error{"a block of boundary records or echo offsets makes no sense", parts_->where,
                 "make the file again"};
}

}  // namespace sonocase
