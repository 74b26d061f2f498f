// SPDX-License-Identifier: Apache-2.0

#include <imgui.h>

#include <algorithm>

#include "runtime/player/app/attempt_steps.h"
#include "runtime/player/app/case_steps.h"
#include "runtime/player/app/tracker_steps.h"
#include "runtime/player/ui/pages.h"
#include "runtime/player/ui/panel_parts.h"
#include "runtime/player/ui/panels.h"
#include "runtime/player/ui/picture_mouse.h"

namespace sonocase::runtime {
namespace {

const char* shape_name(ProbeShape shape) {
    switch (shape) {
        case ProbeShape::linear: return "Linear";
        case ProbeShape::curvilinear: return "Curved";
        case ProbeShape::phased: return "Phased";
    }
    return "";
}

// A child window with the padding and spacing of panels. height 0: the rest of the column.
template <class Draw>
void panel(const char* id, float height, float row_gap, float s, const Draw& draw) {
    ImGui::BeginChild(id, {0, height}, false, ImGuiWindowFlags_AlwaysUseWindowPadding);
    ImGui::PushStyleVar(ImGuiStyleVar_ItemSpacing, {7 * s, row_gap * s});
    draw();
    ImGui::PopStyleVar();
    ImGui::EndChild();
}

void show_top_bar(App& app, const TrackerHealth& tracker, float height, float s) {
    const CaseState& loaded = app.loaded;
    const TopBarRequest request =
        draw_top_bar({loaded.open->exercises, loaded.exercise_index, loaded.image.model,
                      loaded.image.machine, tracker, loaded.frame(), app.view.pictures_per_s},
                     height, s);
    if (request.show_bundles) show_bundles(app.player, app.view);
    if (request.toggle_setup) app.view.show_setup = !app.view.show_setup;
    if (request.toggle_help) app.view.show_help = !app.view.show_help;
    if (request.exercise) choose_exercise(app, *request.exercise);
    if (request.machine) app.loaded.image.machine = *request.machine;
    if (request.model) choose_model(app, *request.model);
}

void show_exercise_panel(App& app) {
    const CaseState& loaded = app.loaded;
    const std::vector<Point3> centres = loaded.target_centres();
    const ExercisePanelRequest request = draw_exercise_panel(
        {loaded.exercise(), loaded.frame().record, centres, app.scan.targets_reached,
         app.scan.attempt.get(), app.scan.score ? &*app.scan.score : nullptr,
         app.scan.tracker.mouse.get()});
    if (request.toggle_attempt) toggle_attempt(app);
    if (request.show_score) app.view.show_score = true;
    if (request.toggle_needle)
        toggle_needle(app.scan.tracker, loaded.exercise().probe, true, app.view.notices);
}

void show_tracker_panel(App& app, const TrackerHealth& health) {
    const CaseState& loaded = app.loaded;
    const TrackerInUse& tracker = app.scan.tracker;
    const std::optional<std::string> chosen = draw_tracker_panel(
        {tracker.spec, loaded.exercise().sweeps, health, loaded.frame(),
         app.scan.controls.assignment, loaded.calibrations, tracker.paced.get()});
    if (chosen) choose_tracker(app, *chosen);
}

void show_left_column(App& app, const TrackerHealth& tracker, float width, float gap, float s) {
    const Settings& settings = app.player.settings;
    const float height = ImGui::GetContentRegionAvail().y;
    ImGui::BeginChild("left", {width, 0}, false, ImGuiWindowFlags_NoBackground);
    if (settings.show_exercise) {
        const float share = settings.show_tracker ? 0.5f * (height - gap) : height;
        panel("exercise", share, 5, s, [&] { show_exercise_panel(app); });
    }
    if (settings.show_tracker) panel("tracker", 0, 5, s, [&] { show_tracker_panel(app, tracker); });
    ImGui::EndChild();
}

ImageViewInput image_input(const App& app, float s) {
    const CaseState& loaded = app.loaded;
    const ImageSettings& image = app.scan.controls.settings;
    const Probe& probe = loaded.exercise().probe;
    const ImageTexture& texture = *app.view.texture;
    ImageViewInput input{loaded.frame(),
                         texture.empty() ? nullptr : texture.id(),
                         probe,
                         app.view.measurements,
                         {},
                         {}};
    input.flipped = image.flip_left_right;
    input.measuring = app.view.measuring;
    input.scale = s;
    input.left_lines = {
        loaded.open->bundle->manifest.case_name,
        std::string(shape_name(probe.shape)) + text("  %.1f MHz", probe.frequency_mhz),
        text("Depth %.1f cm", loaded.image.depth_mm / 10),
        text("Focus %.1f cm", loaded.image.focus_mm / 10)};
    input.right_lines = {text("Gain %+.0f dB", image.gain_db),
                         text("DR %.0f dB", image.dynamic_range_db),
                         text("%.0f frames/s", loaded.frame().frames_per_s)};
    if (app.view.measuring) input.right_lines.push_back("Measure: click two points");
    return input;
}

// The picture, and under it the cine bar while it is frozen.
void show_image(App& app, float width, float gap, float s) {
    ScanControls& controls = app.scan.controls;
    ImGui::BeginChild("middle", {width, 0}, false, ImGuiWindowFlags_NoBackground);
    const float bar = controls.frozen ? 34 * s : 0;
    const ImVec2 room = ImGui::GetContentRegionAvail();
    const int side_px =
        std::clamp(static_cast<int>(std::min(room.x, room.y - bar) / 128) * 128, 512, 1024);
    if (!controls.frozen) fit_image(app, side_px);
    const ImagePlace place =
        draw_image_view(room.x, room.y - bar - (bar > 0 ? gap : 0), image_input(app, s));
    handle_picture_mouse(place, controls.settings.flip_left_right, app.view.measuring,
                         app.view.measurements, app.scan.tracker.mouse.get());
    if (controls.frozen) {
        const ScanFrame& frame = app.loaded.frame();
        draw_cine_bar(controls, app.scan.cine, frame.cine_frames, frame.cine_age_s, bar, s);
    }
    ImGui::EndChild();
}

void show_console_panel(App& app, float s) {
    const ConsoleRequest request =
        draw_console_panel(app.scan.controls, app.loaded.image, app.view.measuring, s);
    if (request.toggle_freeze) set_frozen(app.scan, !app.scan.controls.frozen);
    if (request.depth_by_mm != 0) change_depth(app, request.depth_by_mm);
    if (request.focus_by_mm != 0) change_focus(app, request.focus_by_mm);
}

void show_right_column(App& app, float width, float height, float s) {
    const Settings& settings = app.player.settings;
    CaseState& loaded = app.loaded;
    ImGui::BeginChild("right", {width, 0}, false, ImGuiWindowFlags_NoBackground);
    if (settings.show_3d) {
        const std::vector<Point3> centres = loaded.target_centres();
        draw_view3d_panel(app.view.small_view,
                          {loaded.frame(), *app.view.texture, centres, app.scan.targets_reached,
                           app.scan.controls.settings.flip_left_right, app.player.now_s,
                           *loaded.skin, app.scan.tracker.mouse.get()},
                          std::min(0.34f * height, 0.8f * width), s);
    }
    const float rest = ImGui::GetContentRegionAvail().y;
    const float console = settings.show_effects ? std::min(0.66f * rest, 318 * s) : rest;
    panel("console", console, 5, s, [&] { show_console_panel(app, s); });
    if (settings.show_effects)
        panel("effects", 0, 4, s, [&] { draw_effects_panel(loaded.frame()); });
    ImGui::EndChild();
}

void show_scan_page(App& app, const TrackerHealth& tracker, float s) {
    mark_targets_reached(app.loaded.exercise(), app.loaded.frame().record,
                         app.loaded.target_centres(), app.scan.targets_reached);
    const float gap = 6 * s;
    ImGui::PushStyleVar(ImGuiStyleVar_ItemSpacing, {gap, gap});
    show_top_bar(app, tracker, 38 * s, s);
    const Settings& settings = app.player.settings;
    const ImVec2 area = ImGui::GetContentRegionAvail();
    const bool left = settings.show_exercise || settings.show_tracker;
    const float left_width = std::clamp(0.205f * area.x, 232 * s, 300 * s);
    const float right_width = std::clamp(0.225f * area.x, 262 * s, 340 * s);
    if (left) {
        show_left_column(app, tracker, left_width, gap, s);
        ImGui::SameLine();
    }
    show_image(app, area.x - right_width - gap - (left ? left_width + gap : 0), gap, s);
    ImGui::SameLine();
    show_right_column(app, right_width, area.y, s);
    ImGui::PopStyleVar();
}

void show_setup(App& app, const TrackerHealth& tracker, float s) {
    CaseState& loaded = app.loaded;
    follow_setup(loaded, app.scan.controls.assignment, app.player.now_s);
    const bool save =
        draw_setup_window(*loaded.guide, tracker, loaded.frame().reading, loaded.calibrations,
                          app.scan.controls.assignment, app.view.show_setup, s);
    if (save && save_calibrations(loaded.calibrations, app.player.settings, app.view.notices))
        app.view.show_setup = false;
}

}  // namespace

void draw_page(App& app, const TrackerHealth& tracker) {
    ViewState& view = app.view;
    const float s = view.window->scale();
    ImGui::SetNextWindowPos({0, 0});
    ImGui::SetNextWindowSize(ImGui::GetIO().DisplaySize);
    ImGui::Begin("sonocase", nullptr,
                 ImGuiWindowFlags_NoDecoration | ImGuiWindowFlags_NoMove | ImGuiWindowFlags_NoNav |
                     ImGuiWindowFlags_NoBackground | ImGuiWindowFlags_NoBringToFrontOnFocus |
                     ImGuiWindowFlags_NoSavedSettings);
    if (view.page == Page::bundles || !app.loaded.open) {
        const std::optional<std::string> wanted = draw_bundle_page(view.chooser, s);
        if (wanted) open_bundle(app, *wanted, "");
    } else {
        show_scan_page(app, tracker, s);
    }
    ImGui::End();
    const bool scanning = app.loaded.open && view.page == Page::scan;
    if (view.show_help) draw_help(view.show_help, s);
    if (view.show_setup && scanning) show_setup(app, tracker, s);
    if (view.show_score && app.scan.score && view.page == Page::scan)
        draw_score_window(*app.scan.score, app.scan.score_file, view.show_score, s);
    draw_notices(view.notices, s);
}

}  // namespace sonocase::runtime
