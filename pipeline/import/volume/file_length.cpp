// SPDX-License-Identifier: Apache-2.0

#include <zlib.h>

#include <algorithm>
#include <cctype>
#include <charconv>
#include <filesystem>
#include <fstream>

#include "formats/files/atomic_file.h"
#include "pipeline/base/delimited_text.h"
#include "pipeline/import/volume/native_volume.h"

namespace sonocase::pipeline {
namespace {

namespace fs = std::filesystem;

Error cut_off(std::uint64_t found, std::uint64_t needed, const std::string& path) {
    return {"holds " + std::to_string(found) + " bytes of voxels and its header asks for " +
                std::to_string(needed),
            path, "the file is cut off or damaged; copy or export it again"};
}

// Bytes that a zlib or gzip stream unpacks to; less than `enough` where its end or its checksum is
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
    // "Key = value" lines; ElementDataFile is the last, and LOCAL means that the voxels follow it.
    std::ifstream file(path, std::ios::binary);
    std::string line, data_file;
    bool compressed = false;
    std::uint64_t skip = 0;
    for (int n = 0; n < 1000 && data_file.empty() && std::getline(file, line); ++n) {
        const std::size_t equals = line.find('=');
        if (equals == std::string::npos) continue;
        std::string key = lower_case(line.substr(0, equals)), value = line.substr(equals + 1);
        const auto trim = [](std::string& text) {
            while (!text.empty() && std::isspace(static_cast<unsigned char>(text.back())))
                text.pop_back();
            while (!text.empty() && std::isspace(static_cast<unsigned char>(text.front())))
                text.erase(text.begin());
        };
        trim(key);
        trim(value);
        if (key == "elementdatafile") data_file = value;
        if (key == "compresseddata") compressed = lower_case(value) == "true";
        if (key == "headersize")
            skip = static_cast<std::uint64_t>(std::max(0.0, number_in(value).value_or(0)));
    }
    std::uint64_t begin = 0;
    std::string data_path = path;
    if (lower_case(data_file) == "local") {
        begin = static_cast<std::uint64_t>(file.tellg());
    } else if (data_file.find('%') != std::string::npos || lower_case(data_file) == "list") {
        return Done{};  // one file a slice: the reader misses what is not there
    } else {
        data_path = (fs::path(path).parent_path() / data_file).string();
        begin = skip;
    }
    std::error_code code;
    const std::uint64_t size = fs::file_size(data_path, code);
    if (code)
        return Error{"its data file " + data_path + " is not there", path, "keep the two together"};
    if (!compressed) {
        if (size >= begin + voxel_bytes) return Done{};
        return cut_off(size > begin ? size - begin : 0, voxel_bytes, path);
    }
    const auto packed = sonocase::read_file(data_path);
    if (!packed) return packed.error();
    const std::uint64_t found =
        inflated_bytes(*packed, std::min<std::size_t>(begin, packed->size()), voxel_bytes);
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
