// SPDX-License-Identifier: Apache-2.0

#include "runtime/imaging/physical/model/brick_table.h"

#include <algorithm>
#include <string>
#include <utility>

#ifdef __linux__
#include <sys/mman.h>
#endif

#include "runtime/imaging/core/host.h"

namespace sonocase::runtime {
namespace {

constexpr std::size_t kMaxBlocks = 4096;  // every frame looks at each of them

// Tells the system whether to use pages of 2 MB. They help a jumping probe, which reads all over
// the table; where few blocks are filled in, they cost memory and time at the start.
void use_large_pages(void* memory, std::size_t bytes, bool large) {
#ifdef __linux__
    constexpr std::size_t kPage = 4096;
    const std::size_t skip = (0 - reinterpret_cast<std::uintptr_t>(memory)) % kPage;
    if (bytes < skip + kPage) return;
    // A system without such pages refuses, and nothing is lost.
    (void)madvise(static_cast<std::uint8_t*>(memory) + skip, (bytes - skip) / kPage * kPage,
                  large ? MADV_HUGEPAGE : MADV_NOHUGEPAGE);
#else
    (void)memory, (void)bytes, (void)large;
#endif
}

}  // namespace

Result<BrickTable> BrickTable::create(const CaseBundle& bundle) {
    return create(bundle.label_bricks, &bundle.echo_offset, &bundle.boundary);
}

Result<BrickTable> BrickTable::create(const BrickVolume<std::uint8_t>& labels,
                                      const BrickVolume<std::int8_t>* echo,
                                      const BrickVolume<std::uint32_t>* boundary) {
    BrickTable t;
    t.labels_ = &labels;
    t.echo_ = echo;
    t.boundary_ = boundary;
    t.bricks_ = brick_count(labels.size);
    const auto count = [&] {
        const auto parts = [&](int n) { return (n + (1 << t.edge_log2_) - 1) >> t.edge_log2_; };
        t.blocks_ = {parts(t.bricks_.x), parts(t.bricks_.y), parts(t.bricks_.z)};
        return static_cast<std::size_t>(t.blocks_.x) * t.blocks_.y * t.blocks_.z;
    };
    t.left_ = count();
    while (t.left_ > kMaxBlocks && t.edge_log2_ < 8) {
        ++t.edge_log2_;
        t.left_ = count();
    }
    const auto same = [&](const auto* volume) {
        return volume != nullptr && volume->table.size() == labels.table.size();
    };
    t.has_echo_ = same(echo);
    t.has_boundary_ = same(boundary);
    t.is_loaded_.assign(t.left_, 0);
    t.bytes_ = sizeof(std::uint32_t) * kWords * (t.left_ << 3 * t.edge_log2_);
    void* memory = std::calloc(t.bytes_, 1);  // pages that are never written cost nothing
    if (memory == nullptr) {
        return Error{
            "no memory for the bricks of the bundle: " + std::to_string(t.bytes_ >> 20) + " MB", "",
            "close other programs, or build the case with larger voxels"};
    }
    t.words_.reset(static_cast<std::uint32_t*>(memory));
    use_large_pages(memory, t.bytes_, false);
    return t;
}

void BrickTable::load_all(JobRunner& jobs) {
    use_large_pages(words_.get(), bytes_, true);
    const std::size_t layer = static_cast<std::size_t>(blocks_.x) * blocks_.y;
    parallel_halves(jobs, blocks_.z, [&](std::size_t, std::size_t begin, std::size_t end) {
        std::size_t block = begin * layer;
        for (int z = static_cast<int>(begin); z < static_cast<int>(end); ++z) {
            for (int y = 0; y < blocks_.y; ++y) {
                for (int x = 0; x < blocks_.x; ++x) fill({x, y, z}, block++);
            }
        }
    });
    std::fill(is_loaded_.begin(), is_loaded_.end(), std::uint8_t{1});
    left_ = 0;
}

void BrickTable::fill(Int3 block, std::size_t number) noexcept {
    const int edge = 1 << edge_log2_;
    const Int3 first{block.x << edge_log2_, block.y << edge_log2_, block.z << edge_log2_};
    const bool marks = !marks_.marked.empty();
    const int columns = std::min(edge, bricks_.x - first.x);
    for (int k = 0; k < std::min(edge, bricks_.z - first.z); ++k) {
        for (int j = 0; j < std::min(edge, bricks_.y - first.y); ++j) {
            const std::size_t brick =
                first.x +
                bricks_.x * (first.y + j + bricks_.y * static_cast<std::size_t>(first.z + k));
            const std::size_t row = (number << 3 * edge_log2_) +
                                    (static_cast<std::size_t>(j + (k << edge_log2_)) << edge_log2_);
            std::uint32_t* to = words_.get() + kWords * row;
            for (std::size_t b = brick; b < brick + columns; ++b, to += kWords) {
                const std::uint32_t label = labels_->table[b];
                to[0] = label & kUniformBrick
                            ? kUniformBrick | labels_->uniform[label & ~kUniformBrick]
                            : label;
                const int x = first.x + static_cast<int>(b - brick);
                if (marks && marks_.has({x, first.y + j, first.z + k})) to[0] |= kRegionFlag;
                to[1] = to[2] = kUniformBrick;
                if (has_echo_) {
                    const std::uint32_t e = echo_->table[b];
                    to[1] = e & kUniformBrick
                                ? kUniformBrick |
                                      static_cast<std::uint8_t>(echo_->uniform[e & ~kUniformBrick])
                                : e;
                }
                if (!has_boundary_) continue;
                const std::uint32_t e = boundary_->table[b];
                // A uniform record would be the same plane in 64 voxels, which no surface is.
                if (e & kUniformBrick) continue;
                to[2] = e;
                to[0] |= kBoundaryFlag;
            }
        }
    }
}

}  // namespace sonocase::runtime
