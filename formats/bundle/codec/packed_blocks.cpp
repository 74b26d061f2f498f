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
    const auto bytes = reader.packed(type);
    if (!bytes) return bytes.error();
    const Error wrong = reader.fault(
        "chunk '" + type + "' does not hold the blocks that its grid calls for", "make it again");
    if (bytes->size() / 4 < blocks) return wrong;
    BlockFrames out;
    out.stored_ = *bytes;
    out.frames_.resize(blocks);
    std::uint64_t at = 4 * blocks;
    for (std::size_t block = 0; block < blocks; ++block) {
        Frame& frame = out.frames_[block];
        frame.at = at;
        std::memcpy(&frame.stored, bytes->data() + 4 * block, 4);
        if (frame.stored > bytes->size() - at) return wrong;
        at += frame.stored;
        if (frame.stored == 0) continue;
        const std::uint8_t* from = bytes->data() + frame.at;
        const unsigned long long size = ZSTD_getFrameContentSize(from, frame.stored);
        if (size == 0 || size > max_bytes) return wrong;  // unknown sizes are above any
        frame.bytes = static_cast<std::uint32_t>(size);
        out.largest_ = std::max<std::size_t>(out.largest_, frame.bytes);
    }
    if (at != bytes->size()) return wrong;
    return out;
}

bool BlockFrames::unpack(ZSTD_DCtx_s* context, std::size_t block, std::uint8_t* to) const noexcept {
    const Frame& frame = frames_[block];
    if (frame.stored == 0) return true;
    return ZSTD_decompressDCtx(context, to, frame.bytes, stored_.data() + frame.at, frame.stored) ==
           frame.bytes;
}

}  // namespace sonocase::detail
