// SPDX-License-Identifier: Apache-2.0

#include "formats/bundle/codec/first_layout.h"

#include <algorithm>

#include "formats/bundle/codec/bundle_parts.h"
#include "formats/volume/boundary_record.h"

namespace sonocase::detail {
namespace {

template <class T, class Good>
bool all_values(const BrickVolume<T>& bricks, Good good) {
    return std::all_of(bricks.uniform.begin(), bricks.uniform.end(), good) &&
           std::all_of(bricks.pool.begin(), bricks.pool.end(), good);
}

}  // namespace

Result<VoxelVolumes> read_first_layout(const ChunkReader& reader,
                                       bool with_records,
                                       bool with_offsets,
                                       Int3 size,
                                       std::size_t palette,
                                       JobRunner& jobs) {
    VoxelVolumes out;
    auto labels = read_bricks<std::uint8_t>(reader, "lab", size, jobs);
    if (!labels) return labels.error();
    out.labels = std::move(*labels);
    if (!all_values(out.labels, [&](std::uint8_t v) { return v < palette; }))
        return reader.fault("a voxel has a label beyond the palette", "make the file again");
    if (with_offsets) {
        auto echo = read_bricks<std::int8_t>(reader, "echo", size, jobs);
        if (!echo) return echo.error();
        out.echo_offset = std::move(*echo);
    }
    if (with_records) {
        auto boundary = read_bricks<std::uint32_t>(reader, "bnd", size, jobs);
        if (!boundary) return boundary.error();
        out.boundary = std::move(*boundary);
        if (!all_values(out.boundary, [&](std::uint32_t v) {
                return (v & 0xFFu) < palette || v == kNoBoundary;
            })) {
            return reader.fault("a boundary record has a label beyond the palette",
                                "make the file again");
        }
    }
    return out;
}

}  // namespace sonocase::detail
