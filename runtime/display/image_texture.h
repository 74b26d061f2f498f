// SPDX-License-Identifier: Apache-2.0

// A grey or coloured picture as a texture on the graphics card. All calls belong to the thread of
// the window.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

struct ImDrawList;
struct ImDrawCmd;

namespace sonocase::runtime::inline display {

class ImageTexture {
  public:
    ImageTexture() = default;
    ~ImageTexture();
    ImageTexture(const ImageTexture&) = delete;
    ImageTexture& operator=(const ImageTexture&) = delete;
    // pixels: # width * height, rows from the top.
    void upload(std::span<const std::uint8_t> pixels, int width_px, int height_px);
    // rgb: # 3 * width * height.
    void upload_rgb(std::span<const std::uint8_t> rgb, int width_px, int height_px);
    void* id() const { return reinterpret_cast<void*>(static_cast<std::uintptr_t>(texture_)); }
    unsigned name() const { return texture_; }
    bool empty() const { return texture_ == 0; }

  private:
    void send(int width_px, int height_px);
    unsigned texture_ = 0;
    int width_px_ = 0, height_px_ = 0;
    std::vector<std::uint32_t> rgba_;  // WebGL has no swizzle, which would make this unnecessary
};

// For ImDrawList::AddCallback: what is drawn afterwards replaces what is under it, without
// blending.
void paint_opaque(const ImDrawList*, const ImDrawCmd*);

}  // namespace sonocase::runtime::inline display
