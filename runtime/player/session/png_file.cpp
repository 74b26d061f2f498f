// SPDX-License-Identifier: Apache-2.0

#include "runtime/player/session/png_file.h"

#include <png.h>

#include <cassert>

#include "formats/files/atomic_file.h"

namespace sonocase::runtime {

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
    OutputFile file(path);
    if (!png_image_write_to_file(&image, file.temporary().c_str(), 0, pixels.data(), 0, nullptr)) {
        return Error{std::string("cannot write the picture: ") + image.message, path,
                     "check that the folder is writable and has room"};
    }
    return file.commit();
}

}  // namespace sonocase::runtime
