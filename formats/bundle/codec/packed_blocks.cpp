// SPDX-License-Identifier: Apache-2.0

#include "formats/bundle/codec/packed_blocks.h"

#include <zstd.h>

#include <cstring>

#include "formats/base/jobs.h"

namespace sonocase::detail {
namespace {

constexpr int kZstdLevel = 12;  // higher levels gain nothing on blocks this small

}  // namespace

std::vector<std::uint8_t> pack_blocks(
    const BlockGrid& grid,
    JobRunner& jobs,
    const std::function<void(std::size_t, std::vector<std::uint8_t>*)>& content) {
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
    const auto bytes = reader.packed_in_part(type, 4 * blocks);
    if (!bytes) return bytes.error();
    const Error wrong = reader.fault(
        "chunk '" + type + "' does not hold the blocks that its grid calls for", "make it again");
    if (bytes->size() / 4 < blocks) return wrong;
    BlockFrames out;
    out.stored_ = *bytes;
    out.at_ = reader.place(type).at;
    const bool whole = reader.is_here(type);
    if (!whole) {
        out.arrivals_ = reader.arrivals();
        out.largest_ = max_bytes;
    }
    out.frames_.resize(blocks);
    std::uint64_t at = 4 * blocks;
    for (std::size_t block = 0; block < blocks; ++block) {
        Frame& frame = out.frames_[block];
        frame.at = at;
        std::memcpy(&frame.stored, bytes->data() + 4 * block, 4);
        if (frame.stored > bytes->size() - at) return wrong;
        at += frame.stored;
        if (frame.stored == 0 || !whole) continue;  // what is not there is checked by unpack()
        const std::uint8_t* from = bytes->data() + frame.at;
        const unsigned long long size = ZSTD_getFrameContentSize(from, frame.stored);
        if (size == 0 || size > max_bytes) return wrong;  // unknown sizes are above any
        out.largest_ = std::max(out.largest_, static_cast<std::size_t>(size));
    }
    if (at != bytes->size()) return wrong;
    return out;
}

std::optional<std::size_t> BlockFrames::unpack(ZSTD_DCtx_s* context,
                                               std::size_t block,
                                               std::uint8_t* to) const noexcept {
    const Frame& frame = frames_[block];
    if (frame.stored == 0) return 0;
    const std::uint8_t* from = stored_.data() + frame.at;
    const unsigned long long size = ZSTD_getFrameContentSize(from, frame.stored);
    if (size == 0 || size > largest_) return std::nullopt;  // unknown sizes are above any
    if (ZSTD_decompressDCtx(context, to, largest_, from, frame.stored) != size) return std::nullopt;
    return static_cast<std::size_t>(size);
}

}  // namespace sonocase::detail
