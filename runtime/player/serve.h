// SPDX-License-Identifier: Apache-2.0

// A rendered frame to the OpenIGTLink server.
#pragma once

#include <span>

#include "runtime/engine/scan_engine.h"
#include "runtime/tracking/igtl/igtl_server.h"

namespace sonocase::runtime {

// From the thread that renders; never waits. unix_time_s: of the frame.
void serve_frame(IgtlServer& server,
                 const FrameRecord& record,
                 const Renderer::Layout& layout,
                 int width_px,
                 int height_px,
                 double unix_time_s,
                 std::span<const std::uint8_t> pixels);

double unix_seconds();

}  // namespace sonocase::runtime
