// SPDX-License-Identifier: Apache-2.0

// What a frame shows in a Doppler mode, beside its grey picture.
#pragma once

#include <cstdint>
#include <vector>

#include "runtime/imaging/doppler/colour_image.h"
#include "runtime/imaging/doppler/spectral_strip.h"
#include "runtime/imaging/frame/doppler_settings.h"

namespace sonocase::runtime {

// Pixels of the strip below the picture, and the time that it shows.
inline constexpr int kStripWidth = 768, kStripHeight = 192;
inline constexpr double kStripSeconds = 4;

struct DopplerFrame {
    DopplerMode mode = DopplerMode::off;
    bool has_flow = false;            // the bundle says where blood flows
    std::vector<std::uint8_t> rgb;    // # 3 * pixels of the picture; empty: it is grey
    std::vector<std::uint8_t> strip;  // # kStripWidth * kStripHeight; empty: none
    doppler::SpectralMeasures measures;
    doppler::GateLook gate;
    doppler::ColourReport colour;
};

}  // namespace sonocase::runtime
