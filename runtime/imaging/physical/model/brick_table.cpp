// SPDX-License-Identifier: Apache-2.0

#include "runtime/imaging/physical/model/brick_table.h"

#include <algorithm>
#include <new>

#ifdef __linux__
#include <sys/mman.h>
#endif

#include "runtime/imaging/simd/parallel_halves.h"

namespace sonocase::runtime {
namespace {

constexpr std::size_t kMostBlocks = 4096;  // a frame looks at each

// Whether the system shall find pages of 2 MB for it. They serve a jumping probe, which reads from
// all over the table; where few blocks are filled in they cost a start memory and time.
void use_large_pages(void* memory, std::size_t bytes, bool large) {
#ifdef __linux__
    constexpr std::size_t kPage = 4096;
    const std::size_t skip = (0 - reinterpret_cast<std::uintptr_t>(memory)) % kPage;
    if (bytes < skip + kPage) return;
    // A system without such pages says no, and nothing is lost.
    (void)madvise(static_cast<std::uint8_t*>(memory) + skip, (bytes - skip) / kPage * kPage,
                  large ? MADV_HUGEPAGE : MADV_NOHUGEPAGE);
#else
    (void)memory, (void)bytes, (void)large;
#endif
}

}  // namespace

BrickTable::BrickTable(const CaseBundle& bundle)
    : bundle_(&bundle), bricks_(brick_count(bundle.label_bricks.size)) {
    const auto count = [&] {
        const auto parts = [&](int n) { return (n + (1 << edge_log2_) - 1) >> edge_log2_; };
        blocks_ = {parts(bricks_.x), parts(bricks_.y), parts(bricks_.z)};
        return static_cast<std::size_t>(blocks_.x) * static_cast<std::size_t>(blocks_.y) *
               static_cast<std::size_t>(blocks_.z);
    };
    left_ = count();
    while (left_ > kMostBlocks && edge_log2_ < 8) {
        ++edge_log2_;
        left_ = count();
    }
    const auto same = [&](const auto& volume) {
        return volume.table.size() == bundle.label_bricks.table.size();
    };
    has_echo_ = same(bundle.echo_offset);
    has_boundary_ = same(bundle.boundary);
    there_.assign(left_, 0);
    bytes_ = sizeof(std::uint32_t) * kWords * (left_ << 3 * edge_log2_);
    void* memory = std::calloc(bytes_, 1);  // pages that nobody writes to cost nothing
    if (memory == nullptr) throw std::bad_alloc();
    words_.reset(static_cast<std::uint32_t*>(memory));
    use_large_pages(memory, bytes_, false);
}

void BrickTable::load_all() {
    use_large_pages(words_.get(), bytes_, true);
    const std::size_t layer =
        static_cast<std::size_t>(blocks_.x) * static_cast<std::size_t>(blocks_.y);
    parallel_halves(static_cast<std::size_t>(blocks_.z),
                    [&](std::size_t, std::size_t begin, std::size_t end) {
                        std::size_t block = begin * layer;
                        for (int z = static_cast<int>(begin); z < static_cast<int>(end); ++z) {
                            for (int y = 0; y < blocks_.y; ++y) {
                                for (int x = 0; x < blocks_.x; ++x) fill({x, y, z}, block++);
                            }
                        }
                    });
    std::fill(there_.begin(), there_.end(), std::uint8_t{1});
    left_ = 0;
}

void BrickTable::fill(Int3 block, std::size_t number) noexcept {
    const int edge = 1 << edge_log2_;
    const CaseBundle& bundle = *bundle_;
    const Int3 first{block.x << edge_log2_, block.y << edge_log2_, block.z << edge_log2_};
    const int columns = std::min(edge, bricks_.x - first.x);
    for (int k = 0; k < std::min(edge, bricks_.z - first.z); ++k) {
        for (int j = 0; j < std::min(edge, bricks_.y - first.y); ++j) {
            const std::size_t brick =
                static_cast<std::size_t>(first.x) +
                static_cast<std::size_t>(bricks_.x) *
                    (static_cast<std::size_t>(first.y + j) +
                     static_cast<std::size_t>(bricks_.y) * static_cast<std::size_t>(first.z + k));
            const std::size_t row = (number << 3 * edge_log2_) +
                                    (static_cast<std::size_t>(j + (k << edge_log2_)) << edge_log2_);
            std::uint32_t* to = words_.get() + kWords * row;
            for (std::size_t b = brick; b < brick + static_cast<std::size_t>(columns);
                 ++b, to += kWords) {
                const std::uint32_t label = bundle.label_bricks.table[b];
                to[0] = label & kUniformBrick
                            ? kUniformBrick | bundle.label_bricks.uniform[label & ~kUniformBrick]
                            : label;
                to[1] = to[2] = kUniformBrick;
                if (has_echo_) {
                    const std::uint32_t e = bundle.echo_offset.table[b];
                    to[1] =
                        e & kUniformBrick
                            ? kUniformBrick | static_cast<std::uint8_t>(
                                                  bundle.echo_offset.uniform[e & ~kUniformBrick])
                            : e;
                }
                if (!has_boundary_) continue;
                const std::uint32_t e = bundle.boundary.table[b];
                // A uniform record would be the same plane in 64 voxels: no surface does that.
                if (e & kUniformBrick) continue;
                to[2] = e;
                to[0] |= kBoundaryFlag;
            }
        }
    }
}

}  // namespace sonocase::runtime
