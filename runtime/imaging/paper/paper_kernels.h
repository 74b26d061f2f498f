// SPDX-License-Identifier: Apache-2.0

// What one vectorised call of model `paper` works on: a block of neighbouring beams.
#pragma once

#include <cstdint>

#include "formats/base/geometry.h"
#include "runtime/imaging/core/needle_chord.h"
#include "runtime/imaging/core/simd_target.h"
#include "runtime/imaging/press/press_view.h"

namespace sonocase::runtime {

inline constexpr int kPaperBlock = kBeamBlock;

struct PaperBlock {
    const std::int32_t *start = nullptr, *step = nullptr;  // six rows of `lines` values
    int lines = 0, samples = 0;
    const std::int32_t *table = nullptr, *pool = nullptr, *atlas = nullptr, *flat = nullptr;
    Int3 size;
    int bricks_x = 0, bricks_xy = 0, edge_log2 = 0;
    // Effect deformation; null: nothing is pressed.
    const press::PressView* press = nullptr;
    int first_line = 0;
    // Twelve rows of `lines`, in 1/65536: voxels per mm along the beam (3) and beside it (3),
    // texture periods likewise.
    const float* directions = nullptr;
    const std::int32_t* closed_material = nullptr;
    bool texture = true;
    bool inside = false;  // every sample of the block lies in the volume
    bool with_noise = true, with_shadow = true;
    const std::int8_t* noise = nullptr;
    const std::uint32_t* noise_start = nullptr;
    const std::uint16_t* row_scale = nullptr;
    std::uint16_t shadow_factor = 0;
    static constexpr std::uint32_t kCastsShadow = 0x100;
    std::uint16_t* stage = nullptr;  // samples x kPaperBlock: grey, kCastsShadow where one is cast
    std::uint8_t* image = nullptr;
    int image_stride = 0;
};

// The calls below are vectorised for the instruction set that is named, in integers or in single
// precision in a fixed order.

// Fills the stage; returns the union (bitwise or) of all its values.
std::uint32_t sample_paper_block(SimdTarget simd, const PaperBlock& block);

// Draws the needle over the stage, samples [row_begin, row_end), by the formula of needle_share().
void draw_paper_needle(
    SimdTarget simd, const PaperBlock& block, const NeedleRow& needle, int row_begin, int row_end);

// Adds noise, shadow and brightness to the stage and writes the image.
void finish_paper_block(SimdTarget simd, const PaperBlock& block);

// One row, filtered across beams: out = sum of taps * in / 256. `in` has a margin of `reach` values
// before and behind.
void blur_paper_row(SimdTarget simd,
                    const std::uint8_t* in,
                    int count,
                    const std::uint16_t* taps,
                    int reach,
                    std::uint8_t* out);

}  // namespace sonocase::runtime
