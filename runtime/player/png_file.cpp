#include "runtime/player/png_file.h"

#include <png.h>

#include <cassert>
#include <cerrno>
#include <cstdio>
#include <cstring>

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
    const std::string temporary = path + ".part";
    if (!png_image_write_to_file(&image, temporary.c_str(), 0, pixels.data(), 0, nullptr)) {
        std::remove(temporary.c_str());
        return Error{std::string("cannot write the picture: ") + image.message, path,
                     "check that the folder exists, is writable and has room"};
    }
    if (std::rename(temporary.c_str(), path.c_str()) != 0) {
        std::remove(temporary.c_str());
        return Error{std::string("cannot rename the finished picture: ") + std::strerror(errno),
                     path, "check that the folder is writable"};
    }
    return Done{};
}

}  // namespace sonocase::runtime
