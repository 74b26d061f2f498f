// SPDX-License-Identifier: Apache-2.0

#include "pipeline/pictures/png.h"

#include <png.h>

#include <string>

namespace sonocase::pipeline::inline pictures {
namespace {

std::vector<std::uint8_t> png_of(const std::uint8_t* pixels,
                                 int width_px,
                                 int height_px,
                                 png_uint_32 format) {
    if (width_px <= 0 || height_px <= 0) return {};
    png_image image{};
    image.version = PNG_IMAGE_VERSION;
    image.width = static_cast<png_uint_32>(width_px);
    image.height = static_cast<png_uint_32>(height_px);
    image.format = format;
    std::vector<std::uint8_t> bytes(PNG_IMAGE_PNG_SIZE_MAX(image));
    png_alloc_size_t size = bytes.size();
    if (!png_image_write_to_memory(&image, bytes.data(), &size, 0, pixels, 0, nullptr)) return {};
    bytes.resize(size);
    return bytes;
}

}  // namespace

std::vector<std::uint8_t> png_from_grey(const std::uint8_t* pixels, int width_px, int height_px) {
    return png_of(pixels, width_px, height_px, PNG_FORMAT_GRAY);
}

std::vector<std::uint8_t> png_from_rgb(const std::uint8_t* pixels, int width_px, int height_px) {
    return png_of(pixels, width_px, height_px, PNG_FORMAT_RGB);
}

Result<GreyPicture> grey_from_png(std::span<const std::uint8_t> bytes) {
    constexpr png_uint_32 kMaxEdge = 8192;
    png_image image{};
    image.version = PNG_IMAGE_VERSION;
    if (!png_image_begin_read_from_memory(&image, bytes.data(), bytes.size()))
        return Error{std::string("is no picture: ") + image.message, "", "a PNG"};
    if (image.width > kMaxEdge || image.height > kMaxEdge) {
        png_image_free(&image);
        return Error{"the picture is too large", "", "at most 8192 pixels an edge"};
    }
    image.format = PNG_FORMAT_GRAY;
    GreyPicture out{static_cast<int>(image.width), static_cast<int>(image.height), {}};
    out.pixels.resize(PNG_IMAGE_SIZE(image));
    const png_color black{};
    if (!png_image_finish_read(&image, &black, out.pixels.data(), 0, nullptr))
        return Error{std::string("is no whole picture: ") + image.message, "", "a PNG"};
    return out;
}

}  // namespace sonocase::pipeline::inline pictures
