// SPDX-License-Identifier: Apache-2.0

#include <zlib.h>

#include <algorithm>
#include <array>
#include <cstring>
#include <memory>

#include "pipeline/anatomy/label_table.h"
#include "pipeline/import/volume/native_volume.h"

namespace sonocase::pipeline {
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
    header.has_extensions = bytes[static_cast<std::size_t>(size)] != 0;
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
    constexpr std::int32_t kLargest = 16 << 20;
    const std::unique_ptr<gzFile_s, CloseGz> file(gzopen(path.c_str(), "rb"));
    if (!file) return LabelTable{};
    const NiftiHeader header = read_header(file.get());
    if (!header.has_extensions) return LabelTable{};
    std::int64_t at = header.size + 4;
    while (at + 8 <= header.voxels_at) {
        std::uint8_t head[8];
        if (!read_bytes(file.get(), head, 8)) break;
        const std::int32_t length = int_at(head, header.swapped);
        if (length < 8 || length > kLargest || at + length > header.voxels_at) break;
        std::string content(static_cast<std::size_t>(length) - 8, '\0');
        if (!read_bytes(file.get(), reinterpret_cast<std::uint8_t*>(content.data()),
                        content.size()))
            break;
        at += length;
        auto table = parse_label_xml(content, path);
        if (!table) return table.error();
        if (!table->empty()) return table;
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

}  // namespace sonocase::pipeline
