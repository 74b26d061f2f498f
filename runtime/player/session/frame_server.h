// SPDX-License-Identifier: Apache-2.0

// Hands rendered frames to the OpenIGTLink server, and their poses to the server for pages.
#pragma once

#include <span>

#include "runtime/engine/scan_engine.h"
#include "runtime/tracking/devices/igtl_server.h"
#include "runtime/tracking/devices/pose_server.h"

namespace sonocase::runtime::inline player_session {

// Called by the thread that renders; never waits, and does nothing while no client is connected.
// unix_time_s: of the frame.
void serve_frame(IgtlServer& server,
                 const FrameRecord& record,
                 const Renderer::Layout& layout,
                 int width_px,
                 int height_px,
                 double unix_time_s,
                 std::span<const std::uint8_t> pixels);

// The tools of the frame as they were tracked: the page bends the needle itself.
void serve_poses(PoseServer& server, const FrameRecord& record);

}  // namespace sonocase::runtime::inline player_session
