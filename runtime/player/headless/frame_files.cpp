// SPDX-License-Identifier: Apache-2.0

#include "runtime/player/headless/frame_files.h"

#include <algorithm>
#include <cassert>
#include <cstdio>
#include <filesystem>

#include <nlohmann/json.hpp>

#include "formats/files/atomic_file.h"
#include "runtime/player/session/png_file.h"

namespace sonocase::runtime::inline player_headless {

namespace {

constexpr int kMaxShown = 12;
constexpr int kColumns = 4;

// Frame of the run that stands in place `place` of `shown`.
int frame_at(int place, int shown, int frames) {
    return shown > 1 ? static_cast<int>(static_cast<long long>(place) * (frames - 1) / (shown - 1))
                     : 0;
}

// Characters of 3 x 5 pixels: five rows of three bits, upper left first.
struct Glyph {
    char letter;
    std::uint16_t rows;
};
constexpr Glyph kGlyphs[] = {
    {'0', 0b111'101'101'101'111}, {'1', 0b010'110'010'010'111}, {'2', 0b111'001'111'100'111},
    {'3', 0b111'001'111'001'111}, {'4', 0b101'101'111'001'001}, {'5', 0b111'100'111'001'111},
    {'6', 0b111'100'111'101'111}, {'7', 0b111'001'010'010'010}, {'8', 0b111'101'111'101'111},
    {'9', 0b111'101'111'001'111}, {'-', 0b000'000'111'000'000}, {'.', 0b000'000'000'000'010},
    {'M', 0b101'111'111'101'101}, {'S', 0b011'100'010'001'110}};
constexpr int kGlyphWidth = 3, kGlyphHeight = 5;

}  // namespace

ContactSheet::ContactSheet(int frames, int width, int height)
    : frames_(frames),
      source_width_(width),
      width_(width / 2),
      height_(height / 2),
      shown_(std::min(frames, kMaxShown)),
      columns_(std::min(shown_, kColumns)),
      rows_((shown_ + columns_ - 1) / columns_),
      sheet_(static_cast<std::size_t>(columns_ * width_) * (rows_ * height_)) {
    assert(frames >= 1 && width >= 2 && height >= 2);
}

void ContactSheet::write_caption(int left, int bottom, std::string_view caption) {
    const int size = std::max(1, width_ / 160);  // pixels per dot
    const int length = static_cast<int>(caption.size()) * (kGlyphWidth + 1) * size + size;
    const int high = (kGlyphHeight + 2) * size;
    if (length > width_ || high > height_) return;
    const auto at = [&](int x, int y) -> std::uint8_t& {
        return sheet_[static_cast<std::size_t>(bottom - high + y) * (columns_ * width_) + left + x];
    };
    for (int y = 0; y < high; ++y)
        for (int x = 0; x < length; ++x) at(x, y) = 0;
    for (std::size_t n = 0; n < caption.size(); ++n)
        for (const Glyph& glyph : kGlyphs) {
            if (glyph.letter != caption[n]) continue;
            const int first = (static_cast<int>(n) * (kGlyphWidth + 1) + 1) * size;
            for (int y = 0; y < kGlyphHeight * size; ++y)
                for (int x = 0; x < kGlyphWidth * size; ++x) {
                    const int bit =
                        kGlyphWidth * kGlyphHeight - 1 - (y / size * kGlyphWidth + x / size);
                    if (glyph.rows >> bit & 1) at(first + x, size + y) = 230;
                }
        }
}

void ContactSheet::add(int i, std::span<const std::uint8_t> pixels, std::string_view caption) {
    for (int place = 0; place < shown_; ++place) {
        if (frame_at(place, shown_, frames_) != i) continue;
        const std::size_t source_width = source_width_;
        const int left = place % columns_ * width_, top = place / columns_ * height_;
        for (int y = 0; y < height_; ++y) {
            const std::uint8_t* upper = pixels.data() + 2 * y * source_width;
            const std::uint8_t* lower = upper + source_width;
            std::uint8_t* to =
                sheet_.data() + static_cast<std::size_t>(top + y) * (columns_ * width_) + left;
            for (int x = 0; x < width_; ++x) {
                to[x] = static_cast<std::uint8_t>(
                    (upper[2 * x] + upper[2 * x + 1] + lower[2 * x] + lower[2 * x + 1] + 2) / 4);
            }
        }
        write_caption(left, top + height_, caption);
    }
}

Status ContactSheet::write(const std::string& path, std::string_view copyright) const {
    return write_png(path, columns_ * width_, rows_ * height_, 1, sheet_, copyright);
}

Result<std::unique_ptr<FrameFiles>> FrameFiles::in(const std::string& folder) {
    std::error_code failed;
    std::filesystem::create_directories(folder, failed);
    if (failed) {
        return Error{"cannot make the folder: " + failed.message(), folder,
                     "check the path and its permissions"};
    }
    return std::unique_ptr<FrameFiles>(new FrameFiles(folder));
}

void FrameFiles::begin(int frames, int width_px, int height_px) {
    width_px_ = width_px;
    height_px_ = height_px;
    sheet_.reset();
    if (width_px > 1 && height_px > 1)
        sheet_ = std::make_unique<ContactSheet>(frames, width_px, height_px);
}

std::string FrameFiles::caption(double time_s, const Rigid& mannequin_from_probe) {
    const Vector3& p = mannequin_from_probe.translation;
    char text[96];
    std::snprintf(text, sizeof text, "%.1f S  %.0f %.0f %.0f MM", time_s, p.x, p.y, p.z);
    return text;
}

Status FrameFiles::add(int frame, std::span<const std::uint8_t> pixels, std::string_view caption) {
    char name[32];
    std::snprintf(name, sizeof name, "/frame_%05d.png", frame);
    const Status written = write_png(folder_ + name, width_px_, height_px_, 1, pixels, copyright_);
    if (written && sheet_) sheet_->add(frame, pixels, caption);
    return written;
}

Status FrameFiles::add_colour(int frame,
                              std::span<const std::uint8_t> grey,
                              std::span<const std::uint8_t> rgb,
                              std::string_view caption) {
    char name[32];
    std::snprintf(name, sizeof name, "/frame_%05d.png", frame);
    const auto rows = rgb.size() / 3 / width_px_;
    const Status written =
        write_png(folder_ + name, width_px_, static_cast<int>(rows), 3, rgb, copyright_);
    if (written && sheet_) sheet_->add(frame, grey, caption);
    return written;
}

Status FrameFiles::finish(const About& about) {
    const nlohmann::ordered_json json = {
        {"program", about.program},         {"case", about.case_name},
        {"exercise", about.exercise},       {"picture_height_px", height_px_},
        {"mm_per_px", about.mm_per_px},     {"origin_x_px", about.origin_x_px},
        {"origin_y_px", about.origin_y_px}, {"frames_per_s", about.frames_per_s}};
    const auto replace =
        nlohmann::ordered_json::error_handler_t::replace;  // names need not be UTF-8
    const Status written =
        write_file(folder_ + "/pictures.json", json.dump(1, ' ', false, replace) + "\n");
    if (!written) return written;
    return sheet_ ? sheet_->write(folder_ + "/contact-sheet.png", copyright_) : Status(Done{});
}

}  // namespace sonocase::runtime::inline player_headless
