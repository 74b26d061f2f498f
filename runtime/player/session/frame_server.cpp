// SPDX-License-Identifier: Apache-2.0

#include "runtime/player/session/frame_server.h"

namespace sonocase::runtime::inline player_session {

void serve_frame(IgtlServer& server,
                 const FrameRecord& record,
                 const Renderer::Layout& layout,
                 int width_px,
                 int height_px,
                 double unix_time_s,
                 std::span<const std::uint8_t> pixels) {
    ServedFrame& out = server.slot();
    out.unix_time_s = unix_time_s;
    out.width_px = width_px;
    out.height_px = height_px;
    out.mm_per_px = layout.mm_per_px;
    out.origin_x_px = layout.origin_x_px;
    out.origin_y_px = layout.origin_y_px;
    out.has_probe = record.tools.has_probe;
    out.has_needle = record.tools.has_needle;
    out.force_n = record.press.force_n;
    out.pressure_kpa = record.press.pressure_kpa;
    out.mannequin_from_probe = record.tools.mannequin_from_probe;
    out.mannequin_from_needle = record.needle.mannequin_from_drawn;
    out.pixels.assign(pixels.begin(), pixels.end());
    server.publish();
}

void serve_poses(PoseServer& server, const FrameRecord& record) {
    ServedPoses& out = server.slot();
    out = {record.input.time_s, record.tools.has_probe, record.tools.has_needle,
           record.tools.mannequin_from_probe, record.tools.mannequin_from_needle};
    server.publish();
}

}  // namespace sonocase::runtime::inline player_session
