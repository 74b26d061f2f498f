// SPDX-License-Identifier: Apache-2.0

// The image formation of [Magee], 2007, taken literally: Cartesian pixels, one march per pixel for
// the shadow, and turned copies of the whole picture for the blur. Slow and obvious: the fast
// renderer is tested against it.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "runtime/imaging/core/needle_chord.h"
#include "runtime/imaging/core/scan_geometry.h"
#include "runtime/imaging/paper/paper_model.h"
#include "runtime/imaging/paper/paper_scene.h"
#include "runtime/imaging/press/press_field.h"

namespace sonocase::runtime {

struct PaperFrame {
    Rigid volume_from_probe;              // into the frame of the bundle's grid, mm
    const NeedleShape* needle = nullptr;  // probe frame; null: none
    std::uint32_t seed = 1, frame = 0;
    std::span<const float> row_gain;  // # samples: console gain at each depth, 1 is neutral
    PaperEffects effects;
    const press::PressField* press = nullptr;  // null: nothing is pressed
};

// pixels: # width * height of the geometry.
//
// Order, as printed: texture, needle, noise, shadow, blur, attenuation. Departures: the shadow is
// marched along the pixel's own beam, and not from the middle of the probe's face, since the beams
// of a curved or linear array leave from all over the face (for a phased array both agree); noise
// is drawn per beam sample, so that both renderers see the same draw.
void render_paper_reference(const PaperScene& scene,
                            const ScanGeometry& geometry,
                            std::span<const std::int8_t> noise_tile,
                            const PaperFrame& frame,
                            std::span<std::uint8_t> pixels);

// The noise that both renderers draw from, for at most this many beams.
std::vector<std::int8_t> make_paper_noise(std::uint32_t seed, int scanlines);

// Brightness that attenuation leaves at a depth, relative; 1 without attenuation.
double paper_brightness(double depth_mm, bool attenuation);

}  // namespace sonocase::runtime
