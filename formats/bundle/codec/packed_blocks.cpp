// SPDX-License-Identifier: Apache-2.0

#include "formats/bundle/codec/packed_blocks.h"

#include <algorithm>
#include <bit>
#include <cstring>

#include <zstd.h>

#include "formats/base/jobs.h"
#include "formats/bundle/codec/brick_kinds.h"
#include "formats/bundle/codec/offset_codec.h"
#include "formats/volume/boundary_record.h"

namespace sonocase::detail {

std::vector<std::uint8_t> pack_blocks(
    const BlockGrid& grid,
    JobRunner& jobs,
    const std::function<void(std::size_t, std::vector<std::uint8_t>*)>& content) {
    constexpr int kZstdLevel = 12;  // higher levels gain nothing on blocks this small
    std::vector<std::vector<std::uint8_t>> parts(grid.count());
    jobs.run(parts.size(), [&](std::size_t block) {
        std::vector<std::uint8_t> raw;
        content(block, &raw);
        if (raw.empty()) return;
        std::vector<std::uint8_t>& part = parts[block];
        part.resize(ZSTD_compressBound(raw.size()));
        part.resize(ZSTD_compress(part.data(), part.size(), raw.data(), raw.size(), kZstdLevel));
        part.shrink_to_fit();
    });
    std::vector<std::uint8_t> out(4 * parts.size());
    for (std::size_t block = 0; block < parts.size(); ++block) {
        const auto size = static_cast<std::uint32_t>(parts[block].size());
        std::memcpy(out.data() + 4 * block, &size, 4);
    }
    for (const auto& part : parts) out.insert(out.end(), part.begin(), part.end());
    return out;
}

Result<BlockFrames> BlockFrames::open(const ChunkReader& reader,
                                      const std::string& type,
                                      std::size_t blocks,
                                      std::size_t max_bytes) {
    SONOCASE_TRY(const auto bytes, reader.packed_in_part(type, 4 * blocks));
    const Error wrong = reader.fault(
        "chunk '" + type + "' does not hold the blocks that its grid calls for", "make it again");
    if (bytes.size() / 4 < blocks) return wrong;
    BlockFrames out;
    out.stored_ = bytes;
    out.at_ = reader.place(type).at;
    const bool whole = reader.is_loaded(type);
    if (!whole) {
        out.arrivals_ = reader.arrivals();
        out.largest_ = max_bytes;
    }
    out.frames_.resize(blocks);
    std::uint64_t at = 4 * blocks;
    for (std::size_t block = 0; block < blocks; ++block) {
        Frame& frame = out.frames_[block];
        frame.at = at;
        std::memcpy(&frame.stored, bytes.data() + 4 * block, 4);
        if (frame.stored > bytes.size() - at) return wrong;
        at += frame.stored;
        if (frame.stored == 0 || !whole) continue;  // unpack() checks blocks that are yet to arrive
        const std::uint8_t* from = bytes.data() + frame.at;
        const unsigned long long size = ZSTD_getFrameContentSize(from, frame.stored);
        if (size == 0 || size > max_bytes) return wrong;  // an unknown size is above any limit
        out.largest_ = std::max(out.largest_, static_cast<std::size_t>(size));
    }
    if (at != bytes.size()) return wrong;
    return out;
}

std::optional<std::size_t> BlockFrames::unpack(ZSTD_DCtx_s* context,
                                               std::size_t block,
                                               std::uint8_t* to) const noexcept {
    const Frame& frame = frames_[block];
    if (frame.stored == 0) return 0;
    const std::uint8_t* from = stored_.data() + frame.at;
    const unsigned long long size = ZSTD_getFrameContentSize(from, frame.stored);
    if (size == 0 || size > largest_) return std::nullopt;  // an unknown size is above any limit
    if (ZSTD_decompressDCtx(context, to, largest_, from, frame.stored) != size) return std::nullopt;
    return static_cast<std::size_t>(size);
}

namespace {

template <class T>
void spread(const BrickSpans<T>& volume, std::size_t brick, T* out) {
    const std::uint32_t entry = volume.table[brick];
    if (entry & kUniformBrick) {
        std::fill(out, out + kBrickVoxels, volume.uniform[entry & ~kUniformBrick]);
    } else {
        std::memcpy(out, volume.pool.data() + static_cast<std::size_t>(entry) * kBrickVoxels,
                    kBrickVoxels * sizeof(T));
    }
}

template <class T>
void clear(const BlockParts& parts, std::size_t block, const BrickSpans<T>& volume, T value) {
    parts.grid.each_brick(block, [&](std::size_t brick, bool, bool) {
        const std::uint32_t entry = volume.table[brick];
        if (entry & kUniformBrick) return;
        T* to = volume.pool.data() + static_cast<std::size_t>(entry) * kBrickVoxels;
        std::fill(to, to + kBrickVoxels, value);
    });
}

// Fills in the records that the brick's patches make, and returns where they are.
std::uint32_t* records_of(const BlockParts& parts, std::size_t brick, std::uint32_t entry) {
    BrickLabels uniform;
    const std::uint32_t label_entry = parts.labels.table[brick];
    const std::uint8_t* label = uniform.data();
    if (label_entry & kUniformBrick) {
        uniform.fill(parts.labels.uniform[label_entry & ~kUniformBrick]);
    } else {
        label = parts.labels.pool.data() + static_cast<std::size_t>(label_entry) * kBrickVoxels;
    }
    std::uint32_t* to = parts.boundary.pool.data() + static_cast<std::size_t>(entry) * kBrickVoxels;
    records_from_patches(parts.patches.subspan(parts.first_patch[entry], parts.patch_count[entry]),
                         label, parts.reach_steps, to);
    return to;
}

}  // namespace

BlockUnpacker::BlockUnpacker(const BlockParts& parts) : context_(ZSTD_createDCtx()) {
    bytes_.resize(std::max(parts.corrections ? parts.corrections->largest() : 0,
                           parts.offsets ? parts.offsets->largest() : 0));
}

BlockUnpacker::~BlockUnpacker() {
    ZSTD_freeDCtx(context_);
}

bool BlockUnpacker::unpack(const BlockParts& parts, std::size_t block) noexcept {
    const bool has_records = parts.boundary.table.empty() || records(parts, block);
    if (!has_records) clear(parts, block, parts.boundary, kNoBoundary);
    const bool has_offsets = parts.echo.table.empty() || offsets(parts, block);
    if (!has_offsets) clear(parts, block, parts.echo, std::int8_t{0});
    return has_records && has_offsets;
}

void BlockUnpacker::fill_in(const BlockParts& parts, std::size_t block) noexcept {
    if (!parts.boundary.table.empty()) {
        parts.grid.each_brick(block, [&](std::size_t brick, bool, bool) {
            const std::uint32_t entry = parts.boundary.table[brick];
            if (!(entry & kUniformBrick)) (void)records_of(parts, brick, entry);
        });
    }
    if (!parts.echo.table.empty()) clear(parts, block, parts.echo, std::int8_t{0});
}

bool BlockUnpacker::records(const BlockParts& parts, std::size_t block) noexcept {
    if (!context_) return false;
    const auto bytes = parts.corrections->unpack(context_, block, bytes_.data());
    return bytes && records_with(parts, block, *bytes);
}

// Records as patches make them, with corrections: the first `bytes` of bytes_.
bool BlockUnpacker::records_with(const BlockParts& parts,
                                 std::size_t block,
                                 std::size_t bytes) noexcept {
    std::size_t corrected_bricks = 0;
    parts.grid.each_brick(block, [&](std::size_t brick, bool, bool) {
        const std::uint32_t entry = parts.boundary.table[brick];
        if (!(entry & kUniformBrick)) corrected_bricks += parts.corrected[entry];
    });
    constexpr std::size_t kMask = kBrickVoxels / 8;
    if (bytes < kMask * corrected_bricks || (bytes - kMask * corrected_bricks) % 4 != 0)
        return false;
    const std::uint8_t* mask = bytes_.data();
    const std::size_t words = (bytes - kMask * corrected_bricks) / 4;
    const std::uint8_t* from = mask + kMask * corrected_bricks;
    std::size_t word = 0;
    bool good = true;
    parts.grid.each_brick(block, [&](std::size_t brick, bool, bool) {
        const std::uint32_t entry = parts.boundary.table[brick];
        if (entry & kUniformBrick) return;
        std::uint32_t* to = records_of(parts, brick, entry);
        if (!parts.corrected[entry]) return;
        std::uint64_t wrong;
        std::memcpy(&wrong, mask, kMask);
        mask += kMask;
        if (static_cast<std::size_t>(std::popcount(wrong)) > words - word) {
            good = false;
            wrong = 0;
        }
        for (; wrong != 0; wrong &= wrong - 1, ++word) {
            const auto v = static_cast<std::size_t>(std::countr_zero(wrong));
            std::uint32_t sum = 0;
            for (std::size_t n = 0; n < 4; ++n)
                sum |= (((to[v] >> 8 * n) + from[n * words + word]) & 0xFFu) << 8 * n;
            to[v] = sum;
            good &= sum == kNoBoundary || (sum & 0xFFu) < parts.palette;
        }
    });
    return good && word == words;
}

bool BlockUnpacker::offsets(const BlockParts& parts, std::size_t block) noexcept {
    if (!context_) return false;
    const auto bytes = parts.offsets->unpack(context_, block, bytes_.data());
    if (!bytes) return false;
    const std::uint8_t* from = bytes_.data();
    const std::uint8_t* const end = from + *bytes;
    bool good = true;
    parts.grid.each_brick(block, [&](std::size_t brick, bool has_left, bool has_front) {
        const std::uint32_t entry = parts.echo.table[brick];
        if ((entry & kUniformBrick) || !good) return;
        const bool in_cells = parts.in_cells[entry] != 0;
        good = end - from >= (in_cells ? 8 : kBrickVoxels);
        if (!good) return;
        std::array<std::int8_t, kBrickVoxels> left, front, cells;
        if (has_left) spread(parts.echo, brick - 1, left.data());
        if (has_front)
            spread(parts.echo, brick - static_cast<std::size_t>(parts.grid.bricks.x), front.data());
        const std::int8_t* at_left = has_left ? left.data() : nullptr;
        const std::int8_t* in_front = has_front ? front.data() : nullptr;
        std::int8_t* to = parts.echo.pool.data() + static_cast<std::size_t>(entry) * kBrickVoxels;
        std::int8_t* values = in_cells ? cells.data() : to;
        const auto decode = [&](int v, std::uint8_t prediction) {
            return values[v] = static_cast<std::int8_t>(*from++ + prediction);
        };
        if (!in_cells) {
            walk_offsets<kBrickEdge>(at_left, in_front, decode);
            return;
        }
        walk_offsets<2>(at_left, in_front, decode);
        for (std::size_t v = 0; v < kBrickVoxels; ++v)
            to[v] = cells[v % 4 / 2 + 2 * (v / 4 % 4 / 2) + 4 * (v / 32)];
    });
    return good && from == end;
}

}  // namespace sonocase::detail
