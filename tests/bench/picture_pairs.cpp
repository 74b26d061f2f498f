// SPDX-License-Identifier: Apache-2.0

// Draws real frames above ours, for docs/realism.md:
//   sonocase_pairs OUT.png COLUMN_WIDTH REAL... -- OURS...
// Each frame is cut to what is not black and scaled to the width of a column; the two rows are as
// high as their highest picture.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <string>
#include <vector>

#include "pipeline/look/look_frames.h"
#include "runtime/player/session/png_file.h"

namespace sonocase {
namespace {

struct Picture {
    int width = 0, height = 0;
    std::vector<std::uint8_t> grey;
    std::uint8_t at(int x, int y) const {
        return grey[static_cast<std::size_t>(y) * static_cast<std::size_t>(width) +
                    static_cast<std::size_t>(x)];
    }
};

// Without rows and columns that are black.
Picture cut(const pipeline::LookFrame& frame) {
    const Picture all{frame.width_px, frame.height_px, frame.grey};
    constexpr int kBlack = 4;
    int left = all.width, right = 0, top = all.height, bottom = 0;
    for (int y = 0; y < all.height; ++y) {
        for (int x = 0; x < all.width; ++x) {
            if (all.at(x, y) <= kBlack) continue;
            left = std::min(left, x);
            right = std::max(right, x + 1);
            top = std::min(top, y);
            bottom = std::max(bottom, y + 1);
        }
    }
    if (left >= right) return all;
    Picture out{right - left, bottom - top, {}};
    for (int y = top; y < bottom; ++y) {
        for (int x = left; x < right; ++x) out.grey.push_back(all.at(x, y));
    }
    return out;
}

// The mean over each new pixel's area.
Picture scaled(const Picture& from, int width) {
    const double step = static_cast<double>(from.width) / width;
    Picture out{width, std::max(1, static_cast<int>(std::lround(from.height / step))), {}};
    for (int y = 0; y < out.height; ++y) {
        for (int x = 0; x < width; ++x) {
            double sum = 0, count = 0;
            const auto end = [&](int n, int size) {
                return std::min(static_cast<int>(std::ceil((n + 1) * step)), size);
            };
            for (int v = static_cast<int>(y * step); v < end(y, from.height); ++v) {
                for (int u = static_cast<int>(x * step); u < end(x, from.width); ++u, ++count)
                    sum += from.at(u, v);
            }
            out.grey.push_back(static_cast<std::uint8_t>(std::lround(sum / std::max(count, 1.0))));
        }
    }
    return out;
}

int run(int argc, char** argv) {
    if (argc < 5) {
        std::fprintf(stderr, "usage: sonocase_pairs OUT.png COLUMN_WIDTH REAL... -- OURS...\n");
        return 2;
    }
    const int column = std::clamp(std::atoi(argv[2]), 16, 2000), gap = 4;
    std::vector<std::vector<Picture>> rows(2);
    std::size_t row = 0;
    for (int i = 3; i < argc; ++i) {
        if (std::string(argv[i]) == "--") {
            row = 1;
            continue;
        }
        const auto frame = pipeline::read_look_frame(argv[i]);
        if (!frame) {
            std::fprintf(stderr, "sonocase_pairs: %s\n", frame.error().message().c_str());
            return 1;
        }
        rows[row].push_back(scaled(cut(*frame), column));
    }
    int width = 0, height = 0;
    for (const auto& pictures : rows) {
        int highest = 0;
        for (const Picture& p : pictures) highest = std::max(highest, p.height);
        width = std::max(width, static_cast<int>(pictures.size()) * (column + gap) - gap);
        height += highest + gap;
    }
    if (width <= 0) return 2;
    std::vector<std::uint8_t> page(static_cast<std::size_t>(width) *
                                   static_cast<std::size_t>(height));
    int top = 0;
    for (const auto& pictures : rows) {
        int left = 0, highest = 0;
        for (const Picture& p : pictures) {
            for (int y = 0; y < p.height; ++y) {
                for (int x = 0; x < p.width; ++x)
                    page[static_cast<std::size_t>(top + y) * static_cast<std::size_t>(width) +
                         static_cast<std::size_t>(left + x)] = p.at(x, y);
            }
            left += column + gap;
            highest = std::max(highest, p.height);
        }
        top += highest + gap;
    }
    const Status written = runtime::write_png(argv[1], width, height, 1, page);
    if (!written) std::fprintf(stderr, "sonocase_pairs: %s\n", written.error().message().c_str());
    return written ? 0 : 1;
}

}  // namespace
}  // namespace sonocase

int main(int argc, char** argv) {
    return sonocase::run(argc, argv);
}
