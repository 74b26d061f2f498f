// SPDX-License-Identifier: Apache-2.0

#include "runtime/player/ui/picture_mouse.h"

#include <imgui.h>

namespace sonocase::runtime {

void handle_picture_mouse(const ImagePlace& place,
                          bool flipped,
                          bool measuring,
                          Measurements& measurements,
                          MouseTracker* tracker) {
    const ImGuiIO& io = ImGui::GetIO();
    if (!place.hovered) return;
    const double mm = place.mm_per_screen_px;
    const double flip = flipped ? -1 : 1;
    if (measuring) {
        if (ImGui::IsMouseClicked(0)) {
            measurements.click((io.MousePos.x - place.origin_x) * mm,
                               (io.MousePos.y - place.origin_y) * mm);
        }
        return;
    }
    if (!tracker) return;
    MouseTracker& mouse = *tracker;
    const double dx = io.MouseDelta.x, dy = io.MouseDelta.y;
    const bool needle = mouse.has_needle() && (io.KeyShift || ImGui::IsMouseDown(2));
    if (ImGui::IsMouseDown(0) && !io.KeyShift && (dx != 0 || dy != 0)) {
        // The picture follows the hand: to drag tissue right the probe slides left.
        mouse.slide(-flip * dx * mm, dy * mm);
    }
    if (ImGui::IsMouseDown(1) && (dx != 0 || dy != 0)) {
        mouse.rock(-flip * dx * 0.004);
        mouse.fan(-dy * 0.004);
    }
    if (needle && (ImGui::IsMouseDown(2) || ImGui::IsMouseDown(0)) && (dx != 0 || dy != 0)) {
        mouse.aim_needle(-flip * dx * 0.003, dy * 0.003);
    }
    if (io.MouseWheel != 0) {
        if (io.KeyShift && mouse.has_needle()) {
            mouse.advance_needle(2 * io.MouseWheel);
        } else if (io.KeyCtrl) {
            mouse.press(-io.MouseWheel);
        } else {
            mouse.rotate(0.05 * io.MouseWheel);
        }
    }
}

}  // namespace sonocase::runtime
