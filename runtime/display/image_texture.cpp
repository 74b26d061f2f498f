// SPDX-License-Identifier: Apache-2.0

#include "runtime/display/image_texture.h"

#include <epoxy/gl.h>

#include <cassert>

namespace sonocase::runtime::inline display {

ImageTexture::~ImageTexture() {
    if (texture_) glDeleteTextures(1, &texture_);
}

void ImageTexture::upload(std::span<const std::uint8_t> pixels, int width_px, int height_px) {
    assert(pixels.size() == static_cast<std::size_t>(width_px) * height_px);
    rgba_.resize(pixels.size());
    for (std::size_t i = 0; i < pixels.size(); ++i) rgba_[i] = 0xFF000000u | pixels[i] * 0x010101u;
    send(width_px, height_px);
}

void ImageTexture::upload_rgb(std::span<const std::uint8_t> rgb, int width_px, int height_px) {
    assert(rgb.size() == 3 * static_cast<std::size_t>(width_px) * height_px);
    rgba_.resize(rgb.size() / 3);
    for (std::size_t i = 0; i < rgba_.size(); ++i)
        rgba_[i] = 0xFF000000u | static_cast<std::uint32_t>(rgb[3 * i]) |
                   static_cast<std::uint32_t>(rgb[3 * i + 1]) << 8 |
                   static_cast<std::uint32_t>(rgb[3 * i + 2]) << 16;
    send(width_px, height_px);
}

void ImageTexture::send(int width_px, int height_px) {
    const bool fresh = texture_ == 0 || width_px != width_px_ || height_px != height_px_;
    if (texture_ == 0) glGenTextures(1, &texture_);
    glBindTexture(GL_TEXTURE_2D, texture_);
    glPixelStorei(GL_UNPACK_ALIGNMENT, 4);
    glPixelStorei(GL_UNPACK_ROW_LENGTH, 0);
    if (fresh) {
        glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_MIN_FILTER, GL_LINEAR);
        glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_MAG_FILTER, GL_LINEAR);
        glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_WRAP_S, GL_CLAMP_TO_EDGE);
        glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_WRAP_T, GL_CLAMP_TO_EDGE);
        glTexImage2D(GL_TEXTURE_2D, 0, GL_RGBA8, width_px, height_px, 0, GL_RGBA, GL_UNSIGNED_BYTE,
                     rgba_.data());
        width_px_ = width_px;
        height_px_ = height_px;
    } else {
        glTexSubImage2D(GL_TEXTURE_2D, 0, 0, 0, width_px, height_px, GL_RGBA, GL_UNSIGNED_BYTE,
                        rgba_.data());
    }
}

void paint_opaque(const ImDrawList*, const ImDrawCmd*) {
    glDisable(GL_BLEND);
}

}  // namespace sonocase::runtime::inline display
