// SPDX-License-Identifier: Apache-2.0

#include "pipeline/export/labels/nrrd_file.h"

#include <zlib.h>

#include <algorithm>
#include <charconv>

namespace sonocase::pipeline {
namespace {

// gzip without a time in its header, so that the same volume gives the same bytes.
std::vector<std::uint8_t> gzipped(std::span<const std::uint8_t> bytes) {
    z_stream stream{};
    constexpr int kGzip = 15 + 16;
    deflateInit2(&stream, 4, Z_DEFLATED, kGzip, 8, Z_DEFAULT_STRATEGY);
    std::vector<std::uint8_t> out(std::size_t{1} << 16);
    std::size_t filled = 0, taken = 0;
    int status = Z_OK;
    while (status != Z_STREAM_END) {
        if (stream.avail_in == 0 && taken < bytes.size()) {
            const std::size_t piece = std::min<std::size_t>(bytes.size() - taken, 1u << 30);
            stream.next_in = const_cast<Bytef*>(bytes.data() + taken);
            stream.avail_in = static_cast<uInt>(piece);
            taken += piece;
        }
        if (filled == out.size()) out.resize(2 * out.size());
        const std::size_t room = std::min<std::size_t>(out.size() - filled, 1u << 30);
        stream.next_out = out.data() + filled;
        stream.avail_out = static_cast<uInt>(room);
        status = deflate(&stream, taken == bytes.size() ? Z_FINISH : Z_NO_FLUSH);
        filled += room - stream.avail_out;
    }
    deflateEnd(&stream);
    out.resize(filled);
    return out;
}

std::string number(double value) {
    char text[32];
    return std::string(text, std::to_chars(text, text + sizeof text, value).ptr);
}

std::string triple(double x, double y, double z) {
    return "(" + number(x) + "," + number(y) + "," + number(z) + ")";
}

}  // namespace

std::vector<std::uint8_t> nrrd_file(const NrrdVolume& volume) {
    const Grid& grid = volume.grid;
    std::string header = "NRRD0004\n";
    header += "type: " + volume.type + "\ndimension: 3\nspace: right-anterior-superior\n";
    header += "sizes: " + std::to_string(grid.size.x) + " " + std::to_string(grid.size.y) + " " +
              std::to_string(grid.size.z) + "\nspace directions:";
    for (int axis = 0; axis < 3; ++axis) {
        const Vector3 step = grid.spacing_mm[axis] * grid.direction.column(axis);
        header += " " + triple(step.x, step.y, step.z);
    }
    header += "\nkinds: domain domain domain\nendian: little\nencoding: gzip\nspace origin: " +
              triple(grid.origin_mm.x, grid.origin_mm.y, grid.origin_mm.z) + "\n";
    for (const auto& [key, value] : volume.fields) header += key + ":=" + value + "\n";
    header += "\n";
    std::vector<std::uint8_t> bytes(header.begin(), header.end());
    const std::vector<std::uint8_t> packed = gzipped(volume.bytes);
    bytes.insert(bytes.end(), packed.begin(), packed.end());
    return bytes;
}

}  // namespace sonocase::pipeline
