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

// The orientation cube; a click on a face looks at the patient from there. True: it changed the
// view.
bool draw_cube(Ui& ui, View3d& view, const Box& box) {
    const std::vector<CubeFace> faces = view.cube();
    if (faces.empty()) return false;
    ImDrawList* draw = ImGui::GetWindowDrawList();
    const float s = ui.scale(), half = 0.5f * box.w * s;
    const ImVec2 middle{(box.x + 0.5f * box.w) * s, (box.y + 0.5f * box.h) * s};
    const auto at = [&](const std::array<double, 2>& p) {
        return ImVec2{middle.x + half * static_cast<float>(p[0]),
                      middle.y - half * static_cast<float>(p[1])};
    };
    ButtonStyle style;
    style.ghost = true;
    style.tip = "Right, left, front (A), back (P), head, feet; a click looks from there";
    const bool pressed = ui.button("cube", box, "", style);
    const CubeFace* under = nullptr;
    ImFont* font = fonts().bold;
    for (const CubeFace& face : faces) {
        const ImVec2 p[] = {at(face.corners[0]), at(face.corners[1]), at(face.corners[2]),
                            at(face.corners[3])};
        draw->AddConvexPolyFilled(p, 4, colour::rgba(0x2A, 0x2E, 0x32, 235));
        draw->AddPolyline(p, 4, colour::kImageText, ImDrawFlags_Closed, std::max(s, 1.0f));
        if (face.towards_eye > 0.3) {
            const ImVec2 mid{0.25f * (p[0].x + p[1].x + p[2].x + p[3].x),
                             0.25f * (p[0].y + p[1].y + p[2].y + p[3].y)};
            const float size = 0.8f * font->FontSize;
            const ImVec2 wide = font->CalcTextSizeA(size, 1e9f, 0, face.letter);
            draw->AddText(font, size, {mid.x - 0.5f * wide.x, mid.y - 0.5f * wide.y}, colour::kText,
                          face.letter);
        }
        // Inside if the pointer is on the same side of all edges.
        const ImVec2 m = ImGui::GetIO().MousePos;
        int left = 0;
        for (int i = 0; i < 4; ++i) {
            const ImVec2 a = p[i], b = p[(i + 1) % 4];
            left += (b.x - a.x) * (m.y - a.y) - (b.y - a.y) * (m.x - a.x) > 0;
        }
        if (left == 0 || left == 4) under = &face;
    }
    if (!pressed || !under) return false;
    view.look_at(under->outward);
    return true;
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
    if (card.h > 150 && draw_cube(ui, view, {card.x + 6, card.bottom() - 58, 52, 52}))
        small_view.texture = nullptr;  // drawn anew
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
