// SPDX-License-Identifier: Apache-2.0

// Pictures of the Doppler modes: an overlay's colours on grey, and strips of spectrum and M-mode.
// The player without a window and the Python module draw a whole frame with draw_doppler().
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "runtime/imaging/core/frame_input.h"
#include "runtime/imaging/doppler/doppler_view.h"
#include "runtime/imaging/doppler/m_mode.h"
#include "runtime/imaging/doppler/spectral_strip.h"

namespace sonocase::runtime::doppler {

using Rgb = std::array<std::uint8_t, 3>;

// Colour of each index of an overlay. Mode colour: red to yellow towards the probe, blue to cyan
// away from it, nearly black between. Power: dark red to yellow. Index 0 is no colour.
const std::array<Rgb, 256>& palette(DopplerMode mode);

// rgb: # 3 * pixels, rows from the top.
void compose(std::span<const std::uint8_t> grey,
             std::span<const std::uint8_t> overlay,
             DopplerMode mode,
             std::span<std::uint8_t> rgb);

// The last `seconds` of a strip, the newest at the right, + v_N at the top; grey, # width * height.
// A brighter line marks the envelope, a dim one velocity 0.
void draw_spectrum(const SpectralStrip& strip,
                   double seconds,
                   int width,
                   int height,
                   std::span<std::uint8_t> grey);
void draw_m_mode(const MMode& strip, int width, int height, std::span<std::uint8_t> grey);

}  // namespace sonocase::runtime::doppler

namespace sonocase::runtime {

// Seconds that a strip of spectrum shows.
inline constexpr double kStripSeconds = 4;

// Rows of the picture of a mode, for frames of `height` rows.
inline int doppler_rows(DopplerMode mode, int height) {
    return mode == DopplerMode::spectral || mode == DopplerMode::m_mode ? height + height / 2
                                                                        : height;
}

// A Doppler frame in colour: the picture with its overlay, and below it the strip of a spectrum or
// of M-mode, half as high. rgb: # 3 * width * doppler_rows(mode, height). pixels: the frame that
// the view took last.
void draw_doppler(const DopplerView& view,
                  DopplerMode mode,
                  std::span<const std::uint8_t> pixels,
                  int width,
                  int height,
                  std::span<std::uint8_t> rgb);

}  // namespace sonocase::runtime
