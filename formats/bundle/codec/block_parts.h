// SPDX-License-Identifier: Apache-2.0

// What VoxelBlocks unpacks from, and into what. For the .cpp files of formats/ only.
#pragma once

#include <optional>
#include <span>
#include <string>
#include <vector>

#include "formats/base/raw_vector.h"
#include "formats/bundle/codec/packed_blocks.h"
#include "formats/volume/surface_patch.h"

namespace sonocase::detail {

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

    bool is_here(std::size_t block) const noexcept {
        return (!corrections || corrections->is_here(block)) &&
               (!offsets || offsets->is_here(block));
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
    // For a block that is not there: surfaces as its patches make them, offsets of 0.
    void fill_in(const BlockParts& parts, std::size_t block) noexcept;

  private:
    bool records(const BlockParts& parts, std::size_t block) noexcept;
    bool records_with(const BlockParts& parts, std::size_t block, std::size_t bytes) noexcept;
    bool offsets(const BlockParts& parts, std::size_t block) noexcept;

    ZSTD_DCtx_s* context_;
    std::vector<std::uint8_t> bytes_;
};

}  // namespace sonocase::detail
