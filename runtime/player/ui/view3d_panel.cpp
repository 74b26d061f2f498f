// SPDX-License-Identifier: Apache-2.0

// The small 3-D view: drawing, turning, and placing the mouse's tools in it.
#include <imgui.h>

#include <algorithm>
#include <cmath>

#include "runtime/player/ui/panels.h"
#include "runtime/player/ui/parts/panel_parts.h"
#include "runtime/player/words/words.h"

namespace sonocase::runtime::inline player_ui {
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
    input.exam = panel.exam;
    input.path.assign(panel.path.begin(), panel.path.end());
    input.best.assign(panel.best.begin(), panel.best.end());
    return input;
}

// Left button turns, the wheel moves closer, a double click goes home.
void turn_view(View3d& view, const Ui::Area& mouse) {
    const ImGuiIO& io = ImGui::GetIO();
    Orbit& orbit = view.orbit();
    if (mouse.held && ImGui::IsMouseDown(0)) {
        orbit.yaw_rad -= 0.008 * io.MouseDelta.x;
        orbit.pitch_rad = std::clamp(orbit.pitch_rad + 0.008 * io.MouseDelta.y, -1.5, 1.5);
    }
    if (mouse.hovered && io.MouseWheel != 0) {
        orbit.distance_mm =
            std::clamp(orbit.distance_mm * std::pow(0.9, io.MouseWheel), 150.0, 3000.0);
    }
    if (mouse.double_clicked) {
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

const char* from_words(ViewFrom from) {
    switch (from) {
        case ViewFrom::probe: return "From the probe";
        case ViewFrom::needle: return "From the needle";
        case ViewFrom::outside: break;
    }
    return "From outside";
}

bool view_button(Ui& ui, const char* id, const Box& box, Icon icon, const char* tip) {
    ButtonStyle style;
    style.icon = icon;
    style.ghost = true;
    style.tip = tip;
    return ui.button(id, box, "", style);
}

}  // namespace

void draw_other_view3d(Ui& ui, View3d& view, const View3dPanelInput& input, const Box& card) {
    const float s = ui.scale();
    ui.picture(card, "view3d");
    ui.image(view.draw_for_other(static_cast<int>(card.w * s), static_cast<int>(card.h * s),
                                 view_input(input)),
             card, true, 8);
}

bool draw_view3d_panel(
    Ui& ui, View3d& view, SmallView& small_view, const View3dPanelInput& input, const Box& card) {
    const float s = ui.scale();
    ui.picture(card, "view3d");
    const int width_px = static_cast<int>(card.w * s), height_px = static_cast<int>(card.h * s);
    const bool resized = width_px != small_view.width_px || height_px != small_view.height_px;
    const bool changed = resized || view.from() != small_view.from || small_view.saved;
    if (small_view.pace.due(input.now_s) || !small_view.texture || changed) {
        small_view.texture = view.draw(width_px, height_px, view_input(input));
        small_view.width_px = width_px;
        small_view.height_px = height_px;
        small_view.from = view.from();
    }
    ui.image(small_view.texture, card, true, 8);
    // Before the area, which would take their clicks.
    const float y = card.bottom() - 48;
    const bool swap = view_button(ui, "swap", {card.right() - 48, card.y + 4, 44, 44}, Icon::swap,
                                  "Changes places with the picture (Shift + V)");
    if (view_button(ui, "home3d", {card.right() - 48, y, 44, 44}, Icon::home, "First view")) {
        view.home();
        view.from() = ViewFrom::outside;
    }
    ButtonStyle style;
    style.ghost = true;
    style.left = true;
    style.tip = "From outside, from the probe, from the needle (O)";
    const char* words = tr(from_words(view.from()));
    if (ui.button("from", {card.x + 2, card.y + 4, ui.width(words, Type::body) + 22, 44}, words,
                  style))
        view.from() = view.from() == ViewFrom::outside ? ViewFrom::probe
                      : view.from() == ViewFrom::probe ? ViewFrom::needle
                                                       : ViewFrom::outside;
    const Ui::Area mouse = ui.area("orbit", card);
    turn_view(view, mouse);
    if (mouse.held && ImGui::IsMouseDown(1) && input.mouse)
        place_tool(view, {card.x * s, card.y * s}, input.skin, *input.mouse);
    return swap;
}

}  // namespace sonocase::runtime::inline player_ui
