// SPDX-License-Identifier: Apache-2.0

// Pictures of a fit: the mapped skin coloured by its signed distance to the mannequin, from four
// sides, and three cuts with both outlines.
#pragma once

#include <string>
#include <vector>

#include "formats/base/result.h"
#include "formats/volume/surface.h"
#include "pipeline/registration/map/registration.h"
#include "pipeline/registration/skin/skin_surface.h"

namespace sonocase::pipeline::inline registration {

// Writes fit_views.png and fit_cuts.png into the folder, which is made if it does not exist.
// Distances are clipped at +-limit_mm: blue inside the mannequin, red outside, grey without a
// counterpart. Errors: no display (pipeline/pictures/offscreen_display.h), a folder that cannot be
// written.
Status write_fit_pictures(const SkinSurfaceResult& skin,
                          const Surface& mannequin,
                          const Registration& registration,
                          const std::string& folder,
                          double limit_mm = 5);

}  // namespace sonocase::pipeline::inline registration
