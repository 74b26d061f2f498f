// SPDX-License-Identifier: Apache-2.0

// The order of a bundle's chunks for players that load it in parts (streamed_bundle.h).
#include <algorithm>
#include <array>
#include <string_view>

#include "formats/bundle/codec/bundle_parts.h"
#include "formats/bundle/codec/packed_blocks.h"
#include "formats/bundle/codec/volume_json.h"
#include "formats/bundle/streamed_bundle.h"

namespace sonocase {
namespace {

// Read whole before the first picture; those that are read block by block; and what may come later.
constexpr std::array<std::string_view, 10> kAtOnce{"manifest", "vox.kind", "vox.one",  "vox.mix",
                                                   "vox.pair", "vox.low",  "vox.high", "ofs.kind",
                                                   "ofs.one",  "region"};
constexpr std::array<std::string_view, 2> kInBlocks{"vox.fix", "ofs.val"};
constexpr std::array<std::string_view, 7> kLater{"textures", "flow",     "skin.pat", "skin.fit",
                                                 "speckle",  "skin.man", "preview"};
constexpr int kSmallest = 22;  // level of zstd: chunks are few and packed once

// The first layout has no blocks: all of its volumes come first.
constexpr std::array<std::string_view, 9> kFirstLayout{
    "lab.t", "lab.u", "lab.p", "echo.t", "echo.u", "echo.p", "bnd.t", "bnd.u", "bnd.p"};

std::vector<std::string_view> all_chunks() {
    std::vector<std::string_view> out(kAtOnce.begin(), kAtOnce.end());
    out.insert(out.end(), kFirstLayout.begin(), kFirstLayout.end());
    out.insert(out.end(), kInBlocks.begin(), kInBlocks.end());
    out.insert(out.end(), kLater.begin(), kLater.end());
    return out;
}

}  // namespace

Result<std::vector<ByteRange>> parts_to_open(std::span<const std::uint8_t> bytes,
                                             const std::string& where) {
    const std::vector<std::string_view> known = all_chunks();
    const auto reader = ChunkReader::open(bytes, "CASE", known, where);
    if (!reader) return reader.error();
    const auto json = detail::read_manifest(*reader);
    if (!json) return json.error();
    detail::JsonFault fault{where + ": manifest", {}};
    detail::JsonObject manifest(*json, "", fault);
    detail::BlockGrid grid;
    grid.bricks = brick_count(detail::grid_from(manifest.object("grid")).size);
    if (reader->has("vox.kind"))
        grid.edge = static_cast<int>(manifest.integer("block_bricks", 1, detail::kLargestBlock));
    if (fault.error) return *fault.error;

    std::vector<ByteRange> out{{0, reader->place("manifest").at}};  // header and table
    const auto add = [&](std::string_view type, std::size_t most) {
        const ByteRange place = reader->place(type);
        out.push_back({place.at, std::min(place.count, most)});
    };
    for (const std::string_view type : kAtOnce) add(type, SIZE_MAX);
    for (const std::string_view type : kFirstLayout) add(type, SIZE_MAX);
    for (const std::string_view type : kInBlocks) add(type, 4 * grid.count());  // sizes of blocks
    if (reader->place("textures").at < reader->place(kInBlocks[0]).at)
        add("textures", SIZE_MAX);  // as arranged_for_loading() puts them where they are needed
    std::erase_if(out, [](const ByteRange& r) { return r.count == 0; });
    std::sort(out.begin(), out.end(),
              [](const ByteRange& a, const ByteRange& b) { return a.at < b.at; });
    std::vector<ByteRange> joined;
    for (const ByteRange& range : out) {
        // What lies between neighbouring chunks is padding.
        if (!joined.empty() && range.at <= joined.back().end() + kChunkAlignment) {
            joined.back().count = std::max(joined.back().end(), range.end()) - joined.back().at;
        } else {
            joined.push_back(range);
        }
    }
    return joined;
}

Result<std::vector<std::uint8_t>> arranged_for_loading(std::span<const std::uint8_t> bytes,
                                                       bool textures_at_once,
                                                       const std::string& where,
                                                       JobRunner& jobs) {
    std::vector<std::string_view> order(kAtOnce.begin(), kAtOnce.end());
    if (textures_at_once) order.push_back("textures");
    order.insert(order.end(), kInBlocks.begin(), kInBlocks.end());
    order.insert(order.end(), kLater.begin(), kLater.end());
    return rearranged(bytes, "CASE", order, kSmallest, where, jobs);
}

}  // namespace sonocase
