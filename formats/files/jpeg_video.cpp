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

// Where the JPEG that begins at `from` ends; the file's end where it is cut off. Pictures within a
// picture, such as a phone's preview, are passed over with the segment that they lie in.
std::size_t end_of_jpeg(std::span<const std::uint8_t> b, std::size_t from) {
    constexpr std::uint8_t kBegin = 0xD8, kEnd = 0xD9, kScan = 0xDA;
    std::size_t at = from + 2;
    while (at + 2 <= b.size()) {
        const std::uint8_t code = b[at + 1];
        const bool alone = code <= 0x01 || code == 0xFF || (code >= 0xD0 && code <= 0xD7);
        if (b[at] != 0xFF || alone) {
            ++at;  // of a scan's data
            continue;
        }
        if (code == kEnd) return at + 2;
        if (code == kBegin) return at;  // this one was cut off
        if (at + 4 > b.size()) break;
        at += 2 + (b[at + 2] << 8 | b[at + 3]);
        if (code != kScan) continue;
        while (at + 1 < b.size() &&
               !(b[at] == 0xFF && b[at + 1] >= 0xC0 && (b[at + 1] < 0xD0 || b[at + 1] > 0xD7)))
            ++at;
    }
    return b.size();
}

bool begins_jpeg(std::span<const std::uint8_t> b, std::size_t at) {
    return at + 3 <= b.size() && b[at] == 0xFF && b[at + 1] == 0xD8 && b[at + 2] == 0xFF;
}

}  // namespace

Result<JpegVideo> parse_jpeg_video(std::span<const std::uint8_t> b, const std::string& where) {
    const Error no_avi{"no video of JPEG pictures", where,
                       "use an AVI of them (MJPG), a file of them one after another, or a folder "
                       "of .jpg files"};
    if (begins_jpeg(b, 0)) {
        JpegVideo pictures;
        for (std::size_t at = 0; at < b.size();) {
            if (!begins_jpeg(b, at)) {
                ++at;
                continue;
            }
            const std::size_t end = end_of_jpeg(b, at);
            pictures.pictures.emplace_back(b.begin() + static_cast<std::ptrdiff_t>(at),
                                           b.begin() + static_cast<std::ptrdiff_t>(end));
            at = end;
        }
        return pictures;
    }
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
        return parse_jpeg_video(bytes, path);
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
