// SPDX-License-Identifier: Apache-2.0

#include "runtime/player/ui/pages/picture_mouse.h"

#include <imgui.h>

#include "runtime/player/app/educator/new_target.h"
#include "runtime/player/ui/picture/doppler_marks.h"

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

bool handle_doppler_mouse(App& app, const ImagePlace& place, float scale) {
    DopplerSettings& settings = app.scan.controls.settings.doppler;
    DopplerDrag& drag = app.view.doppler_drag;
    if (settings.mode == DopplerMode::off || app.view.measuring || !ImGui::IsMouseDown(0)) {
        drag = DopplerDrag::none;
        return false;
    }
    if (drag == DopplerDrag::none && !(place.hovered && ImGui::IsMouseClicked(0))) return false;
    const ImGuiIO& io = ImGui::GetIO();
    const bool flipped = app.scan.controls.settings.flip_left_right;
    const ScanGeometry geometry = picture_geometry(app.loaded.frame(), app.loaded.exercise().probe);
    if (drag == DopplerDrag::none)
        drag =
            doppler_hold(place, geometry, settings, flipped, io.MousePos.x, io.MousePos.y, scale);
    drag_doppler(place, geometry, drag, flipped, io.MousePos.x - io.MouseDelta.x,
                 io.MousePos.y - io.MouseDelta.y, io.MousePos.x, io.MousePos.y, settings);
    return drag != DopplerDrag::none;
}

bool handle_marks_mouse(App& app, const ImagePlace& place, const Box& area, float scale) {
    PictureMarks& marks = app.view.marks_on_picture;
    const ImVec2 mouse = ImGui::GetIO().MousePos;
    const double mm = place.mm_per_screen_px;
    const auto x_mm = [&](float x) { return (x - place.origin_x) * mm; };
    const auto z_mm = [&](float y) { return (y - place.origin_y) * mm; };
    const bool clicked = place.hovered && ImGui::IsMouseClicked(0);
    const Box body = body_mark_box(area);
    const float u = (mouse.x / scale - body.x) / body.w, v = (mouse.y / scale - body.y) / body.h;
    if (marks.body && clicked && u >= 0 && u <= 1 && v >= 0 && v <= 1) {
        marks.body_x = u;
        marks.body_y = v;
        return true;
    }
    switch (marks.tool) {
        case MarkTool::none: return false;
        case MarkTool::label:
            if (!clicked) return true;
            marks.placing = {x_mm(mouse.x), z_mm(mouse.y), ""};
            app.view.dialog = Dialog::label;
            return true;
        case MarkTool::zoom: break;
    }
    if (clicked) {
        marks.from_x = mouse.x;
        marks.from_y = mouse.y;
    } else if (marks.from_x >= 0 && !ImGui::IsMouseDown(0)) {
        zoom_to(marks.zoom, x_mm(marks.from_x), z_mm(marks.from_y), x_mm(mouse.x), z_mm(mouse.y),
                area.w * scale * mm, area.h * scale * mm);
        marks.from_x = -1;
        marks.tool = MarkTool::none;
    }
    return true;
}

void place_new_target(App& app, const ImagePlace& place) {
    if (!place.hovered || !ImGui::IsMouseClicked(0)) return;
    const ImGuiIO& io = ImGui::GetIO();
    const double mm = place.mm_per_screen_px;
    const double flip = app.scan.controls.settings.flip_left_right ? -1 : 1;
    set_new_target(app, flip * (io.MousePos.x - place.origin_x) * mm,
                   (io.MousePos.y - place.origin_y) * mm);
}

}  // namespace sonocase::runtime
