// SPDX-License-Identifier: Apache-2.0

// A Doppler frame in colour: the picture with its overlay, and below it the strip of a spectrum or
// of M-mode, half as high. The player without a window and the Python module draw the same one.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "runtime/imaging/doppler/view/doppler_view.h"

namespace sonocase::runtime {

// Seconds that a strip of spectrum shows.
inline constexpr double kStripSeconds = 4;

// Rows of the picture of a mode, for frames of `height` rows.
inline int doppler_rows(DopplerMode mode, int height) {
    return mode == DopplerMode::spectral || mode == DopplerMode::m_mode ? height + height / 2
                                                                        : height;
}

// rgb: # 3 * width * doppler_rows(mode, height). pixels: of the frame that the view took last.
void draw_doppler(const DopplerView& view,
                  DopplerMode mode,
                  std::span<const std::uint8_t> pixels,
                  int width,
                  int height,
                  std::span<std::uint8_t> rgb);

}  // namespace sonocase::runtime
