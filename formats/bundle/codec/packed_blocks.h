// SPDX-License-Identifier: Apache-2.0

// Chunks that can be unpacked in parts: a volume's bricks in blocks of edge^3, each a zstd frame of
// its own; and what VoxelBlocks unpacks from and into. docs/format.md, part 2. For the .cpp files
// of formats/ only.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "formats/base/memory.h"
#include "formats/bundle/codec/chunk_file.h"
#include "formats/volume/brick_volume.h"
#include "formats/volume/surface_patch.h"

struct ZSTD_DCtx_s;

namespace sonocase::detail {

inline constexpr int kMaxBlock = 32;  // bricks per edge

// Blocks, and the bricks of a block, lie x fastest.
struct BlockGrid {
    Int3 bricks{0, 0, 0};  // of the volume
    int edge = 8;          // of a block, bricks

    Int3 blocks() const {
        const auto parts = [&](int n) { return (n + edge - 1) / edge; };
        return {parts(bricks.x), parts(bricks.y), parts(bricks.z)};
    }
    std::size_t count() const {
        const Int3 n = blocks();
        return static_cast<std::size_t>(n.x) * static_cast<std::size_t>(n.y) *
               static_cast<std::size_t>(n.z);
    }
    std::size_t block_bricks() const {
        return static_cast<std::size_t>(edge) * static_cast<std::size_t>(edge) *
               static_cast<std::size_t>(edge);
    }
    Int3 first_brick(std::size_t block) const {
        const Int3 n = blocks();
        const auto x = static_cast<std::size_t>(n.x), y = static_cast<std::size_t>(n.y);
        return {edge * static_cast<int>(block % x), edge * static_cast<int>(block / x % y),
                edge * static_cast<int>(block / x / y)};
    }
    // visit(brick, has_left, has_front): number of the brick, and whether its neighbours in -x and
    // -y belong to the same block.
    template <class Visit>
    void each_brick(std::size_t block, Visit visit) const {
        const Int3 f = first_brick(block);
        for (int k = f.z; k < std::min(f.z + edge, bricks.z); ++k) {
            for (int j = f.y; j < std::min(f.y + edge, bricks.y); ++j) {
                for (int i = f.x; i < std::min(f.x + edge, bricks.x); ++i) {
                    visit(static_cast<std::size_t>(i) + static_cast<std::size_t>(bricks.x) *
                                                            (static_cast<std::size_t>(j) +
                                                             static_cast<std::size_t>(bricks.y) *
                                                                 static_cast<std::size_t>(k)),
                          i > f.x, j > f.y);
                }
            }
        }
    }
};

// content: appends the bytes of a block to an empty vector.
std::vector<std::uint8_t> pack_blocks(
    const BlockGrid& grid,
    JobRunner& jobs,
    const std::function<void(std::size_t block, std::vector<std::uint8_t>*)>& content);

// Where the frames of such a chunk lie. Refers to the bytes of the reader's file and to its
// arrivals. If the file arrives in segments, the chunk's list of sizes must be there.
class BlockFrames {
  public:
    // max_bytes: of an unpacked block.
    static Result<BlockFrames> open(const ChunkReader& reader,
                                    const std::string& type,
                                    std::size_t blocks,
                                    std::size_t max_bytes);
    // No block has more unpacked bytes.
    std::size_t largest() const { return largest_; }
    // The block's bytes in the file.
    ByteRange place(std::size_t block) const {
        return {at_ + static_cast<std::size_t>(frames_[block].at), frames_[block].stored};
    }
    bool is_loaded(std::size_t block) const noexcept {
        return arrivals_ == nullptr || arrivals_->has(place(block));
    }
    // to: # largest(). Returns how many bytes the block has, or nothing if the frame is damaged.
    // Call it only where is_loaded(block).
    std::optional<std::size_t> unpack(ZSTD_DCtx_s* context,
                                      std::size_t block,
                                      std::uint8_t* to) const noexcept;

  private:
    struct Frame {
        std::uint64_t at = 0;
        std::uint32_t stored = 0;
    };
    const Arrivals* arrivals_ = nullptr;
    std::size_t at_ = 0;  // of the chunk
    std::span<const std::uint8_t> stored_;
    std::vector<Frame> frames_;
    std::size_t largest_ = 0;
};

// Refers to the storage of a volume's vectors, which stays in place when a bundle is moved.
template <class T>
struct BrickSpans {
    std::span<const std::uint32_t> table;
    std::span<const T> uniform;
    std::span<T> pool;

    BrickSpans() = default;
    explicit BrickSpans(BrickVolume<T>& volume)
        : table(volume.table), uniform(volume.uniform), pool(volume.pool) {}
};

struct BlockParts {
    BlockGrid grid;
    Int3 size{0, 0, 0};  // voxels
    std::size_t palette = 0;
    int reach_steps = 0;
    std::string where;

    BrickSpans<std::uint8_t> labels;
    BrickSpans<std::uint32_t> boundary;  // table empty: none
    BrickSpans<std::int8_t> echo;        // table empty: none
    // BrickPatches of `boundary`.
    std::span<const std::uint32_t> first_patch;
    std::span<const std::uint8_t> patch_count;
    std::span<const SurfacePatch> patches;
    RawVector<std::uint8_t> corrected;  // of each stored brick of `boundary`
    RawVector<std::uint8_t> in_cells;   // of each stored brick of `echo`
    std::optional<BlockFrames> corrections, offsets;

    bool is_loaded(std::size_t block) const noexcept {
        return (!corrections || corrections->is_loaded(block)) &&
               (!offsets || offsets->is_loaded(block));
    }
};

// Unpacks blocks, one at a time. Where zstd finds no memory for its context, every block fails.
class BlockUnpacker {
  public:
    explicit BlockUnpacker(const BlockParts& parts);
    ~BlockUnpacker();
    BlockUnpacker(const BlockUnpacker&) = delete;
    BlockUnpacker& operator=(const BlockUnpacker&) = delete;
    // False where the block's bytes are not valid; the block is then empty.
    bool unpack(const BlockParts& parts, std::size_t block) noexcept;
    // For a block that has not arrived: surfaces as its patches make them, offsets of 0.
    void fill_in(const BlockParts& parts, std::size_t block) noexcept;

  private:
    bool records(const BlockParts& parts, std::size_t block) noexcept;
    bool records_with(const BlockParts& parts, std::size_t block, std::size_t bytes) noexcept;
    bool offsets(const BlockParts& parts, std::size_t block) noexcept;

    ZSTD_DCtx_s* context_;
    std::vector<std::uint8_t> bytes_;
};

}  // namespace sonocase::detail
