// SPDX-License-Identifier: Apache-2.0

#include "formats/files/jpeg_video.h"

#include <algorithm>
#include <cstring>
#include <filesystem>

#include "formats/files/atomic_file.h"

namespace sonocase {
namespace {

std::uint32_t u32_at(std::span<const std::uint8_t> b, std::size_t at) {
    return b[at] | b[at + 1] << 8 | b[at + 2] << 16 | static_cast<std::uint32_t>(b[at + 3]) << 24;
}
bool named(std::span<const std::uint8_t> b, std::size_t at, const char* name) {
    return std::memcmp(b.data() + at, name, 4) == 0;
}

}  // namespace

Result<JpegVideo> parse_avi(std::span<const std::uint8_t> b, const std::string& where) {
    const Error no_avi{"no AVI video", where,
                       "use an AVI of JPEG pictures (MJPG), or a folder of .jpg files"};
    if (b.size() < 12 || !named(b, 0, "RIFF") || !named(b, 8, "AVI ")) return no_avi;
    JpegVideo video;
    bool is_mjpg = false;
    std::size_t at = 12;
    while (at + 8 <= b.size()) {
        const std::size_t size = u32_at(b, at + 4);
        // Lists are gone into; what a recording that was cut off promises beyond its end is left.
        if (named(b, at, "LIST") || named(b, at, "RIFF")) {
            at += 12;
            continue;
        }
        if (size > b.size() - at - 8) break;
        const std::size_t body = at + 8;
        if (named(b, at, "avih") && size >= 4) {
            const std::uint32_t period_us = u32_at(b, body);
            if (period_us > 0) video.rate_hz = 1e6 / period_us;
        } else if (named(b, at, "strh") && size >= 8 && named(b, body, "vids")) {
            is_mjpg = is_mjpg || named(b, body + 4, "MJPG") || named(b, body + 4, "mjpg");
        } else if (b[at + 2] == 'd' && (b[at + 3] == 'c' || b[at + 3] == 'b')) {
            video.pictures.emplace_back(b.begin() + static_cast<std::ptrdiff_t>(body),
                                        b.begin() + static_cast<std::ptrdiff_t>(body + size));
        }
        at = body + size + size % 2;
    }
    if (!is_mjpg || video.pictures.empty()) return no_avi;
    return video;
}

Result<JpegVideo> load_jpeg_video(const std::string& path) {
    namespace fs = std::filesystem;
    std::error_code ignored;
    if (!fs::is_directory(path, ignored)) {
        SONOCASE_TRY(const std::vector<std::uint8_t> bytes, read_file(path));
        return parse_avi(bytes, path);
    }
    std::vector<std::string> files;
    for (const auto& entry : fs::directory_iterator(path, ignored)) {
        std::string ending = entry.path().extension().string();
        std::transform(ending.begin(), ending.end(), ending.begin(),
                       [](char c) { return c >= 'A' && c <= 'Z' ? static_cast<char>(c + 32) : c; });
        if (ending == ".jpg" || ending == ".jpeg") files.push_back(entry.path().string());
    }
    std::sort(files.begin(), files.end());
    if (files.empty())
        return Error{"a folder without JPEG pictures", path, "put .jpg files into it"};
    JpegVideo video;
    for (const std::string& file : files) {
        SONOCASE_TRY(std::vector<std::uint8_t> bytes, read_file(file));
        video.pictures.push_back(std::move(bytes));
    }
    return video;
}

}  // namespace sonocase
