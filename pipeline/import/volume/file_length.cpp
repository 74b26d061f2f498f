// SPDX-License-Identifier: Apache-2.0

#include <zlib.h>

#include <algorithm>
#include <filesystem>

#include "formats/files/atomic_file.h"
#include "pipeline/import/volume/data_file.h"
#include "pipeline/import/volume/native_volume.h"

namespace sonocase::pipeline {
namespace {

namespace fs = std::filesystem;

Error cut_off(std::uint64_t found, std::uint64_t needed, const std::string& path) {
    return {"holds " + std::to_string(found) + " bytes of voxels and its header asks for " +
                std::to_string(needed),
            path, "the file is cut off or damaged; copy or export it again"};
}

// Bytes that a zlib or gzip stream unpacks to; less than `enough` if its end or its checksum is
// missing.
std::uint64_t inflated_bytes(const std::vector<std::uint8_t>& packed,
                             std::size_t at,
                             std::uint64_t enough) {
    z_stream stream{};
    if (inflateInit2(&stream, 15 + 32) != Z_OK) return 0;
    std::vector<std::uint8_t> out(1 << 20);
    std::uint64_t total = 0;
    int status = Z_OK;
    while (status == Z_OK) {
        if (stream.avail_in == 0) {
            const std::size_t piece = std::min<std::size_t>(packed.size() - at, 1u << 30);
            if (piece == 0) break;
            stream.next_in = const_cast<Bytef*>(packed.data() + at);
            stream.avail_in = static_cast<uInt>(piece);
            at += piece;
        }
        stream.next_out = out.data();
        stream.avail_out = static_cast<uInt>(out.size());
        status = inflate(&stream, Z_NO_FLUSH);
        total += out.size() - stream.avail_out;
    }
    inflateEnd(&stream);
    return status == Z_STREAM_END ? total : std::min(total, enough - 1);
}

}  // namespace

Status check_meta_length(const std::string& path, std::uint64_t voxel_bytes) {
    if (!path.ends_with(".mha") && !path.ends_with(".mhd")) return Done{};
    const MetaHeader header = read_meta_header(path);
    if (header.many_files) return Done{};  // one file per slice: the reader misses absent ones
    std::error_code code;
    const std::uint64_t size = fs::file_size(header.data_path, code);
    if (code)
        return Error{"its data file " + header.data_path + " is not there", path,
                     "keep the two together"};
    if (!header.compressed) {
        if (size >= header.voxels_at + voxel_bytes) return Done{};
        return cut_off(size > header.voxels_at ? size - header.voxels_at : 0, voxel_bytes, path);
    }
    const auto packed = sonocase::read_file(header.data_path);
    if (!packed) return packed.error();
    const std::uint64_t found = inflated_bytes(
        *packed, std::min<std::size_t>(header.voxels_at, packed->size()), voxel_bytes);
    if (found < voxel_bytes) return cut_off(found, voxel_bytes, path);
    return Done{};
}

Status check_nrrd_length(const std::string& path, std::uint64_t voxel_bytes) {
    if (!path.ends_with(".nrrd")) return Done{};
    const auto bytes = sonocase::read_file(path);
    if (!bytes) return bytes.error();
    // Lines up to an empty one; "data file" means that the voxels are elsewhere.
    bool gzip = false;
    for (std::size_t at = 0; at < bytes->size();) {
        const auto end = std::find(bytes->begin() + static_cast<std::ptrdiff_t>(at), bytes->end(),
                                   std::uint8_t{'\n'});
        std::string line(bytes->begin() + static_cast<std::ptrdiff_t>(at), end);
        at = static_cast<std::size_t>(end - bytes->begin()) + 1;
        if (!line.empty() && line.back() == '\r') line.pop_back();
        if (line.starts_with("data file:") || line.starts_with("datafile:")) return Done{};
        if (line == "encoding: gzip" || line == "encoding: gz") gzip = true;
        if (!line.empty()) continue;
        if (!gzip) return Done{};  // the reader counts raw bytes itself
        const std::uint64_t found =
            inflated_bytes(*bytes, std::min(at, bytes->size()), voxel_bytes);
        if (found < voxel_bytes) return cut_off(found, voxel_bytes, path);
        return Done{};
    }
    return Done{};
}

}  // namespace sonocase::pipeline
