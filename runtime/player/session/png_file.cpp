// SPDX-License-Identifier: Apache-2.0

#include "runtime/player/session/png_file.h"

#include <png.h>
#include <zlib.h>

#include <cassert>

#include "formats/files/atomic_file.h"

namespace sonocase::runtime::inline player_session {
namespace {

constexpr std::size_t kHeaderEnd = 8 + 25;  // signature and IHDR: texts may follow

Error cannot_write(const png_image& image, const std::string& path) {
    return {std::string("cannot write the picture: ") + image.message, path,
            "check that the folder is writable and has room"};
}

Status write_image(png_image& image, const std::string& path, const void* pixels) {
    OutputFile file(path);
    if (!png_image_write_to_file(&image, file.temporary().c_str(), 0, pixels, 0, nullptr))
        return cannot_write(image, path);
    return file.commit();
}

void append_big_endian(std::string& to, unsigned long value) {
    for (int shift = 24; shift >= 0; shift -= 8) to += static_cast<char>(value >> shift & 255);
}

// An international text chunk, not compressed.
std::string text_chunk(std::string_view keyword, std::string_view text) {
    std::string body = "iTXt";
    body += keyword;
    body += std::string_view("\0\0\0\0\0", 5);  // keyword's end, plain, no language, no translation
    body += text;
    std::string chunk;
    append_big_endian(chunk, body.size() - 4);
    chunk += body;
    append_big_endian(chunk, crc32(0, reinterpret_cast<const Bytef*>(body.data()),
                                   static_cast<uInt>(body.size())));
    return chunk;
}

// libpng's simple interface has no texts: the chunk is put behind the header.
Status write_image_with(png_image& image,
                        const std::string& path,
                        const void* pixels,
                        std::string_view copyright) {
    png_alloc_size_t size = PNG_IMAGE_PNG_SIZE_MAX(image);
    std::string bytes(size, '\0');
    if (!png_image_write_to_memory(&image, bytes.data(), &size, 0, pixels, 0, nullptr))
        return cannot_write(image, path);
    bytes.resize(size);
    bytes.insert(kHeaderEnd, text_chunk("Copyright", copyright));
    return write_file(path, bytes);
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
                 std::span<const std::uint8_t> pixels,
                 std::string_view copyright) {
    assert(channels == 1 || channels == 3);
    assert(pixels.size() == static_cast<std::size_t>(width) * height * channels);
    png_image image{};
    image.version = PNG_IMAGE_VERSION;
    image.width = static_cast<png_uint_32>(width);
    image.height = static_cast<png_uint_32>(height);
    image.format = channels == 1 ? PNG_FORMAT_GRAY : PNG_FORMAT_RGB;
    image.flags = PNG_IMAGE_FLAG_FAST;
    if (!copyright.empty()) return write_image_with(image, path, pixels.data(), copyright);
    return write_image(image, path, pixels.data());
}

}  // namespace sonocase::runtime::inline player_session
