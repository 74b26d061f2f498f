// SPDX-License-Identifier: Apache-2.0

#include "runtime/player/headless/contact_sheet.h"

#include <algorithm>
#include <cassert>

#include "runtime/player/session/png_file.h"

namespace sonocase::runtime {
namespace {

constexpr int kMostShown = 12;
constexpr int kColumns = 4;

// Frame of the run that stands in place `place` of `shown`.
int frame_at(int place, int shown, int frames) {
    return shown > 1 ? static_cast<int>(static_cast<long long>(place) * (frames - 1) / (shown - 1))
                     : 0;
}

}  // namespace

ContactSheet::ContactSheet(int frames, int width, int height)
    : frames_(frames),
      source_width_(width),
      width_(width / 2),
      height_(height / 2),
      shown_(std::min(frames, kMostShown)),
      columns_(std::min(shown_, kColumns)),
      rows_((shown_ + columns_ - 1) / columns_),
      sheet_(static_cast<std::size_t>(columns_ * width_) *
             static_cast<std::size_t>(rows_ * height_)) {
    assert(frames >= 1 && width >= 2 && height >= 2);
}

void ContactSheet::add(int i, std::span<const std::uint8_t> pixels) {
    for (int place = 0; place < shown_; ++place) {
        if (frame_at(place, shown_, frames_) != i) continue;
        const std::size_t source_width = static_cast<std::size_t>(source_width_);
        const int left = place % columns_ * width_, top = place / columns_ * height_;
        for (int y = 0; y < height_; ++y) {
            const std::uint8_t* upper =
                pixels.data() + static_cast<std::size_t>(2 * y) * source_width;
            const std::uint8_t* lower = upper + source_width;
            std::uint8_t* to =
                sheet_.data() +
                static_cast<std::size_t>(top + y) * static_cast<std::size_t>(columns_ * width_) +
                left;
            for (int x = 0; x < width_; ++x) {
                to[x] = static_cast<std::uint8_t>(
                    (upper[2 * x] + upper[2 * x + 1] + lower[2 * x] + lower[2 * x + 1] + 2) / 4);
            }
        }
    }
}

Status ContactSheet::write(const std::string& path) const {
    return write_png(path, columns_ * width_, rows_ * height_, 1, sheet_);
}

}  // namespace sonocase::runtime
