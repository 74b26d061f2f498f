// SPDX-License-Identifier: Apache-2.0

#include "pipeline/import/volume/volume_header.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <memory>

#include <zlib.h>

#include "formats/files/atomic_file.h"
#include "pipeline/base/source_checks.h"
#include "pipeline/base/text.h"

namespace sonocase::pipeline::inline import_volume {

namespace {

namespace fs = std::filesystem;

constexpr int kMaxHeaderLines = 1000;
constexpr const char* kExpected = "expected a file with the voxels";

bool names_many_files(const std::string& data_file) {
    return data_file.find('%') != std::string::npos || lower_case(data_file).starts_with("list");
}

std::string beside(const std::string& path, const std::string& data_file) {
    return (fs::path(path).parent_path() / data_file).string();
}

std::string folder_of(const std::string& path) {
    const fs::path folder = fs::path(path).parent_path();
    return folder.empty() ? "." : folder.string();
}

// The value of "data file:" in a NRRD header; empty if the voxels follow the header.
std::string nrrd_data_file(const std::string& path) {
    std::ifstream file(path, std::ios::binary);
    std::string line;
    for (int n = 0; n < kMaxHeaderLines && std::getline(file, line); ++n) {
        line = std::string(trimmed(line));
        if (line.empty()) break;
        for (const char* key : {"data file:", "datafile:"}) {
            if (lower_case(line).starts_with(key))
                return std::string(trimmed(line.substr(std::char_traits<char>::length(key))));
        }
    }
    return {};
}

Status check_data_file(const std::string& path, const std::string& data_path) {
    std::error_code code;
    if (!fs::exists(data_path, code))
        return Error{"its data file " + data_path + " is not there", path, "keep the two together"};
    return check_source_file(data_path, kExpected);
}

}  // namespace

MetaHeader read_meta_header(const std::string& path) {
    // "Key = value" lines; ElementDataFile is the last, and LOCAL means that the voxels follow it.
    MetaHeader header;
    std::ifstream file(path, std::ios::binary);
    std::string line, data_file;
    std::uint64_t skip = 0;
    for (int n = 0; n < kMaxHeaderLines && data_file.empty() && std::getline(file, line); ++n) {
        const std::size_t equals = line.find('=');
        if (equals == std::string::npos) continue;
        const std::string key(trimmed(lower_case(line.substr(0, equals))));
        const std::string value(trimmed(line.substr(equals + 1)));
        if (key == "elementdatafile") data_file = value;
        if (key == "compresseddata") header.compressed = lower_case(value) == "true";
        if (key == "headersize")
            skip = static_cast<std::uint64_t>(std::max(0.0, number_in(value).value_or(0)));
    }
    if (lower_case(data_file) == "local") {
        header.data_path = path;
        header.voxels_at = static_cast<std::uint64_t>(file.tellg());
    } else if (names_many_files(data_file)) {
        header.many_files = true;
    } else if (!data_file.empty()) {
        header.data_path = beside(path, data_file);
        header.voxels_at = skip;
    }
    return header;
}

Status check_data_files(const std::string& path) {
    if (path.ends_with(".mha") || path.ends_with(".mhd")) {
        const MetaHeader header = read_meta_header(path);
        if (header.many_files) return check_source_folder(folder_of(path), kExpected);
        // A header that is cut off names no file: the reader reports it.
        if (header.data_path.empty() || header.data_path == path) return Done{};
        return check_data_file(path, header.data_path);
    }
    if (path.ends_with(".nrrd") || path.ends_with(".nhdr")) {
        const std::string data_file = nrrd_data_file(path);
        if (data_file.empty()) return Done{};
        if (names_many_files(data_file)) return check_source_folder(folder_of(path), kExpected);
        return check_data_file(path, beside(path, data_file));
    }
    return Done{};
}

namespace {

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
    SONOCASE_TRY(const auto packed, read_file(header.data_path));
    const std::uint64_t found =
        inflated_bytes(packed, std::min<std::size_t>(header.voxels_at, packed.size()), voxel_bytes);
    if (found < voxel_bytes) return cut_off(found, voxel_bytes, path);
    return Done{};
}

Status check_nrrd_length(const std::string& path, std::uint64_t voxel_bytes) {
    if (!path.ends_with(".nrrd")) return Done{};
    SONOCASE_TRY(const auto bytes, read_file(path));
    // Lines up to an empty one; "data file" means that the voxels are elsewhere.
    bool gzip = false;
    for (std::size_t at = 0; at < bytes.size();) {
        const auto end = std::find(bytes.begin() + static_cast<std::ptrdiff_t>(at), bytes.end(),
                                   std::uint8_t{'\n'});
        std::string line(bytes.begin() + static_cast<std::ptrdiff_t>(at), end);
        at = static_cast<std::size_t>(end - bytes.begin()) + 1;
        if (!line.empty() && line.back() == '\r') line.pop_back();
        if (line.starts_with("data file:") || line.starts_with("datafile:")) return Done{};
        if (line == "encoding: gzip" || line == "encoding: gz") gzip = true;
        if (!line.empty()) continue;
        if (!gzip) return Done{};  // the reader counts raw bytes itself
        const std::uint64_t found = inflated_bytes(bytes, std::min(at, bytes.size()), voxel_bytes);
        if (found < voxel_bytes) return cut_off(found, voxel_bytes, path);
        return Done{};
    }
    return Done{};
}

namespace {

struct CloseGz {
    void operator()(gzFile_s* file) const { gzclose(file); }
};

std::int32_t int_at(const std::uint8_t* bytes, bool swapped) {
    std::array<std::uint8_t, 4> b{bytes[0], bytes[1], bytes[2], bytes[3]};
    if (swapped) std::reverse(b.begin(), b.end());
    std::int32_t value = 0;
    std::memcpy(&value, b.data(), 4);
    return value;
}

// NIfTI-1 has 348 bytes of header, NIfTI-2 540; then four bytes of which the first says whether
// extensions follow; each is its size (with these eight bytes), a code and its content. The voxels
// begin at vox_offset: a float at byte 108, or in NIfTI-2 a 64-bit number at 168.
struct NiftiHeader {
    std::int64_t size = 0;  // 0: not a NIfTI file
    bool swapped = false;
    bool has_extensions = false;
    bool has_orientation = false;  // qform_code or sform_code is not 0
    std::int64_t voxels_at = 0;
};

bool read_bytes(gzFile_s* file, std::uint8_t* to, std::size_t count) {
    return gzread(file, to, static_cast<unsigned>(count)) == static_cast<int>(count);
}

NiftiHeader read_header(gzFile_s* file) {
    NiftiHeader header;
    std::vector<std::uint8_t> bytes(4);
    if (!read_bytes(file, bytes.data(), 4)) return header;
    std::int32_t size = int_at(bytes.data(), false);
    if (size != 348 && size != 540) {
        header.swapped = true;
        size = int_at(bytes.data(), true);
    }
    if (size != 348 && size != 540) return header;
    bytes.resize(static_cast<std::size_t>(size) + 4);
    if (!read_bytes(file, bytes.data() + 4, bytes.size() - 4)) return header;
    header.size = size;
    header.has_extensions = bytes[size] != 0;
    const auto first_code = bytes.begin() + (size == 348 ? 252 : 344);  // two codes side by side
    header.has_orientation = std::any_of(first_code, first_code + (size == 348 ? 4 : 8),
                                         [](std::uint8_t byte) { return byte != 0; });
    if (size == 348) {
        const std::int32_t bits = int_at(bytes.data() + 108, header.swapped);
        float offset = 0;
        std::memcpy(&offset, &bits, 4);
        header.voxels_at = offset >= 352 && offset < 2e9f ? static_cast<std::int64_t>(offset) : 352;
    } else {
        header.voxels_at = int_at(bytes.data() + (header.swapped ? 172 : 168), header.swapped);
    }
    return header;
}

}  // namespace

Result<LabelTable> load_nifti_label_table(const std::string& path) {
    constexpr std::int32_t kMax = 16 << 20;
    const std::unique_ptr<gzFile_s, CloseGz> file(gzopen(path.c_str(), "rb"));
    if (!file) return LabelTable{};
    const NiftiHeader header = read_header(file.get());
    if (!header.has_extensions) return LabelTable{};
    std::int64_t at = header.size + 4;
    while (at + 8 <= header.voxels_at) {
        std::uint8_t head[8];
        if (!read_bytes(file.get(), head, 8)) break;
        const std::int32_t length = int_at(head, header.swapped);
        if (length < 8 || length > kMax || at + length > header.voxels_at) break;
        std::string content(static_cast<std::size_t>(length) - 8, '\0');
        if (!read_bytes(file.get(), reinterpret_cast<std::uint8_t*>(content.data()),
                        content.size()))
            break;
        at += length;
        SONOCASE_TRY(auto table, parse_label_xml(content, path));
        if (!table.empty()) return table;
    }
    return LabelTable{};
}

std::string nifti_orientation_warning(const std::string& path) {
    if (!path.ends_with(".nii") && !path.ends_with(".nii.gz")) return "";
    const std::unique_ptr<gzFile_s, CloseGz> file(gzopen(path.c_str(), "rb"));
    if (!file) return "";
    const NiftiHeader header = read_header(file.get());
    if (header.size == 0 || header.has_orientation) return "";
    return "the file does not say how its axes lie in the patient (qform_code and sform_code are "
           "0), so right and left may be exchanged: check on which side the liver is, or export "
           "the file again with its orientation";
}

Status check_nifti_length(const std::string& path, std::uint64_t voxel_bytes) {
    if (!path.ends_with(".nii") && !path.ends_with(".nii.gz")) return Done{};
    const char* todo = "the file is cut off or damaged; copy or export it again";
    const std::unique_ptr<gzFile_s, CloseGz> file(gzopen(path.c_str(), "rb"));
    if (!file) return Error{"cannot open", path, "check that it may be read"};
    gzbuffer(file.get(), 1 << 18);
    const NiftiHeader header = read_header(file.get());
    if (header.size == 0) return Done{};  // an older format that ITK knows and this code does not
    std::uint64_t position = static_cast<std::uint64_t>(header.size) + 4;
    const std::uint64_t needed = static_cast<std::uint64_t>(header.voxels_at) + voxel_bytes;
    std::vector<std::uint8_t> buffer(1 << 20);
    for (;;) {
        const int count = gzread(file.get(), buffer.data(), static_cast<unsigned>(buffer.size()));
        if (count > 0) position += static_cast<std::uint64_t>(count);
        if (count < static_cast<int>(buffer.size())) break;
    }
    int code = Z_OK;
    gzerror(file.get(), &code);
    if (position < needed)
        return Error{"holds " + std::to_string(position) + " bytes of the " +
                         std::to_string(needed) + " that its header asks for",
                     path, todo};
    if (code != Z_OK && code != Z_STREAM_END) return Error{"damaged compression", path, todo};
    return Done{};
}

}  // namespace sonocase::pipeline::inline import_volume
