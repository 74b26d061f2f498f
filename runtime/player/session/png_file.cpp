// SPDX-License-Identifier: Apache-2.0

#include "runtime/player/session/png_file.h"

#include <png.h>

#include <cassert>

#include "formats/files/atomic_file.h"

namespace sonocase::runtime {
namespace {

Status write_image(png_image& image, const std::string& path, const void* pixels) {
    OutputFile file(path);
    if (!png_image_write_to_file(&image, file.temporary().c_str(), 0, pixels, 0, nullptr)) {
        return Error{std::string("cannot write the picture: ") + image.message, path,
                     "check that the folder is writable and has room"};
    }
    return file.commit();
}

}  // namespace

// The library takes 16 bits as linear light, which it writes as they are; without this flag it
// would convert them to sRGB of 8 bits.
Status write_png16(const std::string& path,
                   int width,
                   int height,
                   std::span<const std::uint16_t> pixels) {
    assert(pixels.size() == static_cast<std::size_t>(width) * height);
    png_image image{};
    image.version = PNG_IMAGE_VERSION;
    image.width = static_cast<png_uint_32>(width);
    image.height = static_cast<png_uint_32>(height);
    image.format = PNG_FORMAT_LINEAR_Y;
    image.flags = PNG_IMAGE_FLAG_FAST;
    return write_image(image, path, pixels.data());
}

Status write_png(const std::string& path,
                 int width,
                 int height,
                 int channels,
                 std::span<const std::uint8_t> pixels) {
    assert(channels == 1 || channels == 3);
    assert(pixels.size() == static_cast<std::size_t>(width) * height * channels);
    png_image image{};
    image.version = PNG_IMAGE_VERSION;
    image.width = static_cast<png_uint_32>(width);
    image.height = static_cast<png_uint_32>(height);
    image.format = channels == 1 ? PNG_FORMAT_GRAY : PNG_FORMAT_RGB;
    image.flags = PNG_IMAGE_FLAG_FAST;
    return write_image(image, path, pixels.data());
}

}  // namespace sonocase::runtime
