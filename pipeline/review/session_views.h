// SPDX-License-Identifier: Apache-2.0

// 3-D pictures of a session: body, structures to be spared, targets, trails of probe and needle,
// and the needle where it came to rest. VTK, offscreen.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "formats/base/result.h"
#include "pipeline/review/review_input.h"

namespace sonocase::pipeline {

struct SessionView {
    std::string title;
    std::vector<std::uint8_t> png;
};

// Four directions: the whole body, across the scan plane, along it, and down the needle. Cost:
// about a second and a half a view on two cores without a graphics card.
Result<std::vector<SessionView>> render_session_views(const ReviewInput& input,
                                                      const ReviewOptions& options);

// 8-bit grey picture as PNG.
std::vector<std::uint8_t> png_from_grey(const std::uint8_t* pixels, int width_px, int height_px);

}  // namespace sonocase::pipeline
