// What one vectorised call of model `paper` works on: a block of neighbouring beams.
#pragma once

#include <cstdint>

#include "formats/geometry.h"
#include "runtime/imaging/needle_strip.h"

namespace sonocase::runtime {

inline constexpr int kPaperBlock = kBeamBlock;

struct PaperBlock {
    const std::int32_t *start = nullptr, *step = nullptr;  // six rows of `lines` values
    int lines = 0, samples = 0;
    const std::int32_t *table = nullptr, *pool = nullptr, *atlas = nullptr, *flat = nullptr;
    Int3 size;
    int bricks_x = 0, bricks_xy = 0, edge_log2 = 0;
    bool texture = true;
    bool inside = false;  // every sample of the block lies in the volume
    bool with_noise = true, with_shadow = true;
    const std::int8_t* noise = nullptr;
    const std::uint32_t* noise_start = nullptr;
    const std::uint16_t* row_scale = nullptr;
    std::uint16_t shadow_factor = 0;
    std::uint16_t* stage = nullptr;  // samples x kPaperBlock: grey, bit 8 where a shadow is cast
    std::uint8_t* image = nullptr;
    int image_stride = 0;
};

}  // namespace sonocase::runtime
