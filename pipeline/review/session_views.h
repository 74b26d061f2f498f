// SPDX-License-Identifier: Apache-2.0

// 3-D pictures of a session: body, structures to spare, targets, paths of probe and needle, and the
// needle where it came to rest. Rendered off-screen by VTK.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "formats/base/result.h"
#include "pipeline/review/review_input.h"

namespace sonocase::pipeline::inline review {

struct SessionView {
    std::string title;
    std::vector<std::uint8_t> png;
};

// Four directions: the whole body, across the scan plane, along it, and down the needle.
// Error: no display (offscreen_display.h). Cost: about 1.5 s per view on two cores without a
// graphics card.
Result<std::vector<SessionView>> render_session_views(const ReviewInput& input,
                                                      const ReviewOptions& options);

}  // namespace sonocase::pipeline::inline review
