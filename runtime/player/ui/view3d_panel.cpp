// SPDX-License-Identifier: Apache-2.0

// The small 3-D view: drawing, turning, and placing the mouse's tools in it.
#include <imgui.h>

#include <algorithm>
#include <cmath>

#include "runtime/player/ui/panel_parts.h"
#include "runtime/player/ui/panels.h"

namespace sonocase::runtime {
namespace {

View3dInput view_input(const View3dPanelInput& panel) {
    const ScanFrame& frame = panel.frame;
    const ToolPoses& tools = frame.record.tools;
    View3dInput input;
    input.has_probe = tools.has_probe;
    input.has_needle = tools.has_needle;
    input.in_contact = frame.status == FrameStatus::rendered;
    input.mannequin_from_probe = tools.mannequin_from_probe;
    input.mannequin_from_needle = frame.record.needle.mannequin_from_drawn;
    input.layout = frame.layout;
    input.depth_mm = frame.depth_mm;
    input.image_width_px = frame.width_px;
    input.image_height_px = frame.height_px;
    input.flipped = panel.flipped;
    input.image_texture = panel.texture.name();
    input.show_targets = panel.shows_targets;
    input.targets_reached = panel.targets_reached;
    input.target_centres.assign(panel.target_centres.begin(), panel.target_centres.end());
    return input;
}

// Left button turns, the wheel moves closer, a double click goes home.
void turn_view(View3d& view) {
    const ImGuiIO& io = ImGui::GetIO();
    Orbit& orbit = view.orbit();
    if (ImGui::IsItemActive() && ImGui::IsMouseDown(0)) {
        orbit.yaw_rad -= 0.008 * io.MouseDelta.x;
        orbit.pitch_rad = std::clamp(orbit.pitch_rad + 0.008 * io.MouseDelta.y, -1.5, 1.5);
    }
    if (ImGui::IsItemHovered() && io.MouseWheel != 0) {
        orbit.distance_mm =
            std::clamp(orbit.distance_mm * std::pow(0.9, io.MouseWheel), 150.0, 3000.0);
    }
    if (ImGui::IsItemHovered() && ImGui::IsMouseDoubleClicked(0)) {
        view.home();
        view.from() = ViewFrom::outside;
    }
}

// The right button puts the probe, or with Shift the needle, where it points.
void place_tool(const View3d& view, ImVec2 corner, const Skin& skin, MouseTracker& mouse) {
    const ImGuiIO& io = ImGui::GetIO();
    const ViewRay ray = view.ray(io.MousePos.x - corner.x, io.MousePos.y - corner.y);
    const auto touch = skin.enter(ray.start, ray.direction, 4000);
    if (!touch) return;
    const Vector3 inward = -1 * skin.normal(*touch);
    if (io.KeyShift) {
        mouse.place_needle(*touch, inward);
    } else {
        mouse.put_probe(*touch, inward);
    }
}

}  // namespace

void draw_view3d_panel(SmallView& small_view,
                       const View3dPanelInput& input,
                       float height,
                       float s) {
    View3d& view = *small_view.view;
    ImGui::BeginChild("view3d", {0, height}, false, ImGuiWindowFlags_NoScrollbar);
    const ImVec2 size = ImGui::GetContentRegionAvail();
    const ImVec2 corner = ImGui::GetCursorScreenPos();
    if (small_view.pace.due(input.now_s) || !small_view.texture) {
        small_view.texture =
            view.draw(static_cast<int>(size.x), static_cast<int>(size.y), view_input(input));
    }
    ImGui::GetWindowDrawList()->AddImageRounded(small_view.texture, corner,
                                                {corner.x + size.x, corner.y + size.y}, {0, 1},
                                                {1, 0}, 0xFFFFFFFF, 5 * s);
    ImGui::InvisibleButton("orbit", size,
                           ImGuiButtonFlags_MouseButtonLeft | ImGuiButtonFlags_MouseButtonRight);
    turn_view(view);
    if (ImGui::IsItemActive() && ImGui::IsMouseDown(1) && input.mouse)
        place_tool(view, corner, input.skin, *input.mouse);
    if (view.from() != ViewFrom::outside) {
        ImGui::SetCursorPos({6 * s, 4 * s});
        small_dim(view.from() == ViewFrom::probe ? "from the probe (O)" : "from the needle (O)");
    }
    ImGui::EndChild();
}

}  // namespace sonocase::runtime
