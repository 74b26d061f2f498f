// SPDX-License-Identifier: Apache-2.0

// What renderer options mean to those who look beside the picture, as truth and Doppler modes do:
// which effects move tissue, and how the picture is laid out.
#pragma once

#include "formats/base/result.h"
#include "formats/exercise/exercise.h"
#include "runtime/imaging/frame/render_options.h"
#include "runtime/imaging/scan/scan_geometry.h"

namespace sonocase::runtime {

// Which of an image model's effects move tissue.
struct MovingEffects {
    bool contact = false, breathing = false, pulsation = false, deformation = false;
};
// Errors: those of choose_effects.
Result<MovingEffects> moving_effects(const RenderOptions& options);

// The geometry that a renderer of these options draws in.
ScanGeometry shown_geometry(const Exercise& exercise, const RenderOptions& options);

}  // namespace sonocase::runtime
