// SPDX-License-Identifier: Apache-2.0

#include "runtime/imaging/doppler/view/doppler_picture.h"

#include <cassert>

#include "runtime/imaging/doppler/doppler_colours.h"

namespace sonocase::runtime {

void draw_doppler(const DopplerView& view,
                  DopplerMode mode,
                  std::span<const std::uint8_t> pixels,
                  int width,
                  int height,
                  std::span<std::uint8_t> rgb) {
    const int below = doppler_rows(mode, height) - height;
    const auto row = static_cast<std::size_t>(width);
    const std::size_t picture = row * static_cast<std::size_t>(height),
                      strip = row * static_cast<std::size_t>(below);
    assert(pixels.size() == picture && rgb.size() == 3 * (picture + strip));
    doppler::compose(pixels, view.overlay(), mode, rgb.first(3 * picture));
    if (below == 0) return;
    // The strip is drawn in grey into the end of its own place, and spread out from the front.
    const std::span<std::uint8_t> grey = rgb.subspan(3 * picture + 2 * strip, strip);
    if (mode == DopplerMode::spectral)
        doppler::draw_spectrum(view.spectrum(), kStripSeconds, width, below, grey);
    else
        doppler::draw_m_mode(view.m_mode(), width, below, grey);
    std::uint8_t* to = rgb.data() + 3 * picture;
    for (std::size_t i = 0; i < strip; ++i) {
        const std::uint8_t value = grey[i];
        for (int c = 0; c < 3; ++c) *to++ = value;
    }
}

}  // namespace sonocase::runtime
