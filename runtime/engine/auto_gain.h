// SPDX-License-Identifier: Apache-2.0

// Gain and depth gain set once from a picture, as a machine's button does, in the window and in a
// browser.
#pragma once

#include <cstdint>
#include <span>

#include "runtime/imaging/core/frame_input.h"
#include "runtime/imaging/renderer.h"

namespace sonocase::runtime::inline engine {

// Changes `settings`, with which the picture was drawn, to a middling brightness, and half the way
// to that at all depths. pixels: # rows of width_px, from the top. law: of the renderer that drew
// them, since a decibel is more grey on one machine than on another. A picture without echoes
// changes nothing.
void adjust_gain(std::span<const std::uint8_t> pixels,
                 int width_px,
                 const Renderer::Layout& layout,
                 double depth_mm,
                 const GainLaw& law,
                 ImageSettings& settings);

}  // namespace sonocase::runtime::inline engine
