// SPDX-License-Identifier: Apache-2.0

// The image formation of 2007 taken literally: Cartesian pixels, one march per pixel for the
// shadow, turned copies of the whole picture for the blur. Slow and obvious; the oracle of the fast
// renderer.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "runtime/imaging/needle/needle_chord.h"
#include "runtime/imaging/paper/paper_scene.h"
#include "runtime/imaging/scan/scan_geometry.h"

namespace sonocase::runtime {

struct PaperEffects {
    bool texture = true, needle = true, noise = true, shadow = true, attenuation = true,
         blur = true;
};

struct PaperFrame {
    Rigid volume_from_probe;  // into voxel coordinates' frame: the bundle's grid frame, mm
    const NeedleShape* needle = nullptr;  // probe frame; null: none
    std::uint32_t seed = 1, frame = 0;
    std::span<const float> row_gain;  // # samples: console gain at each depth, 1 is neutral
    PaperEffects effects;
};

// pixels: # width * height of the geometry.
//
// Order, as printed: texture, needle, noise, shadow, blur, attenuation. Departures: the shadow is
// marched along the pixel's own beam, from the probe face, and not from the middle of the face,
// since the beams of a curved or linear array leave from all over it (for a phased array both
// agree); noise is drawn per beam sample, so that both renderers see the same draw.
void render_paper_reference(const PaperScene& scene,
                            const ScanGeometry& geometry,
                            std::span<const std::int8_t> noise_tile,
                            const PaperFrame& frame,
                            std::span<std::uint8_t> pixels);

// Brightness at a depth: attenuation and console gain.
double paper_brightness(double depth_mm, bool attenuation);

}  // namespace sonocase::runtime
