// SPDX-License-Identifier: Apache-2.0

// Pictures of the Doppler modes: an overlay's colours on grey, and strips of spectrum and M-mode.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "runtime/imaging/doppler/m_mode.h"
#include "runtime/imaging/doppler/spectral_strip.h"
#include "runtime/imaging/frame/doppler_settings.h"

namespace sonocase::runtime::doppler {

using Rgb = std::array<std::uint8_t, 3>;

// Of an overlay's index. Colour: red to yellow towards the probe, blue to cyan away from it, nearly
// black between. Power: dark red to yellow. Index 0 is no colour.
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
