// SPDX-License-Identifier: Apache-2.0

// Pictures of the window under a virtual display: taken, read, made small, compared.
#pragma once

#include <png.h>

#include <cstdint>
#include <cstdlib>
#include <string>
#include <vector>

namespace sonocase::testing {

struct Picture {
    int width = 0, height = 0;
    std::vector<std::uint8_t> rgb;
    // Mean brightness of a rectangle, [0, 255].
    double mean(int x0, int y0, int x1, int y1) const {
        double sum = 0;
        for (int y = y0; y < y1; ++y) {
            for (int x = x0; x < x1; ++x)
                sum += rgb[3 * (static_cast<std::size_t>(y) * width + x) + 1];
        }
        return sum / ((x1 - x0) * (y1 - y0));
    }
    // Share of pixels of a rectangle that differ by more than so many levels.
    double difference(const Picture& other, int x0, int y0, int x1, int y1, int levels = 8) const {
        int changed = 0;
        for (int y = y0; y < y1; ++y) {
            for (int x = x0; x < x1; ++x) {
                const std::size_t i = 3 * (static_cast<std::size_t>(y) * width + x) + 1;
                changed += std::abs(rgb[i] - other.rgb[i]) > levels;
            }
        }
        return double(changed) / ((x1 - x0) * (y1 - y0));
    }
    // Means of blocks of `by` x `by` pixels.
    Picture reduced(int by) const {
        Picture small{width / by, height / by, {}};
        for (int y = 0; y < small.height; ++y) {
            for (int x = 0; x < small.width; ++x) {
                for (int c = 0; c < 3; ++c) {
                    int sum = by * by / 2;
                    for (int v = 0; v < by; ++v) {
                        for (int u = 0; u < by; ++u) {
                            const auto at =
                                static_cast<std::size_t>(by * y + v) * width + by * x + u;
                            sum += rgb[3 * at + c];
                        }
                    }
                    small.rgb.push_back(static_cast<std::uint8_t>(sum / (by * by)));
                }
            }
        }
        return small;
    }
};

// A picture of width 0 if the file cannot be read.
inline Picture load_picture(const std::string& path) {
    Picture picture;
    png_image image{};
    image.version = PNG_IMAGE_VERSION;
    if (!png_image_begin_read_from_file(&image, path.c_str())) return picture;
    image.format = PNG_FORMAT_RGB;
    picture.width = static_cast<int>(image.width);
    picture.height = static_cast<int>(image.height);
    picture.rgb.resize(PNG_IMAGE_SIZE(image));
    png_image_finish_read(&image, nullptr, picture.rgb.data(), 0, nullptr);
    return picture;
}

inline bool save_picture(const Picture& picture, const std::string& path) {
    png_image image{};
    image.version = PNG_IMAGE_VERSION;
    image.format = PNG_FORMAT_RGB;
    image.width = static_cast<png_uint_32>(picture.width);
    image.height = static_cast<png_uint_32>(picture.height);
    return png_image_write_to_file(&image, path.c_str(), 0, picture.rgb.data(), 0, nullptr) != 0;
}

}  // namespace sonocase::testing
