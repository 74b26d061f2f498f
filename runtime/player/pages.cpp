// SPDX-License-Identifier: Apache-2.0

// The two pages of the window: the list of bundles and the scan with its panels.
#include <imgui.h>

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "runtime/display/theme.h"
#include "runtime/player/app.h"

namespace sonocase::runtime {
namespace {

std::string text(const char* format, double value) {
    char line[64];
    std::snprintf(line, sizeof line, format, value);
    return line;
}

const char* shape_name(ProbeShape shape) {
    switch (shape) {
        case ProbeShape::linear:
            return "Linear";
        case ProbeShape::curvilinear:
            return "Curved";
        case ProbeShape::phased:
            return "Phased";
    }
    return "";
}

unsigned phase_colour(TrackerPhase phase) {
    switch (phase) {
        case TrackerPhase::streaming:
            return colour::kGood;
        case TrackerPhase::failed:
            return colour::kBad;
        case TrackerPhase::ended:
            return colour::kDim;
        default:
            return colour::kWarn;
    }
}

void dot(unsigned packed) {
    const float r = 0.27f * ImGui::GetTextLineHeight();
    const ImVec2 at = ImGui::GetCursorScreenPos();
    ImGui::GetWindowDrawList()->AddCircleFilled({at.x + r, at.y + 0.5f * ImGui::GetFrameHeight()},
                                                r, packed, 16);
    ImGui::Dummy({3.2f * r, ImGui::GetFrameHeight()});
    ImGui::SameLine(0, 0);
}

}  // namespace

void draw_bundle_page(App& app) {
    const float s = app.window->scale();
    const ImVec2 size = ImGui::GetContentRegionAvail();
    const float width = std::min(size.x, 760 * s);
    ImGui::SetCursorPos({0.5f * (ImGui::GetWindowWidth() - width), 0.09f * size.y});
    ImGui::BeginChild("start", {width, 0.84f * size.y}, false, ImGuiWindowFlags_NoBackground);
    ImGui::PushFont(fonts().title);
    ImGui::TextUnformatted("sonocase");
    ImGui::PopFont();
    ImGui::TextDisabled("Ultrasound-guided needle placement. Choose a case.");
    ImGui::Dummy({0, 8 * s});
    const float list_height = ImGui::GetContentRegionAvail().y - 74 * s;
    ImGui::BeginChild("list", {0, list_height});
    const float pad = 8 * s;
    ImGui::SetCursorPos({pad, pad});
    ImGui::BeginGroup();
    if (app.bundles.empty()) {
        ImGui::TextWrapped(
            "No case bundle was found in %s/cases, the system's data folders or this folder.",
            data_folder().empty() ? "~/.local/share/sonocase" : data_folder().c_str());
        ImGui::TextDisabled(
            "Make one with: sonocase build scenarios/demo-torso/case.toml -o demo.sonocase");
    }
    for (std::size_t i = 0; i < app.bundles.size(); ++i) {
        const BundleEntry& entry = app.bundles[i];
        ImGui::PushID(static_cast<int>(i));
        const ImVec2 at = ImGui::GetCursorPos();
        const float row = 46 * s;
        const bool chosen = static_cast<int>(i) == app.bundle_cursor;
        if (ImGui::Selectable("##row", chosen, 0, {width - 2 * pad, row})) {
            app.bundle_cursor = static_cast<int>(i);
            open_bundle(app, entry.path, "");
            ImGui::PopID();
            break;
        }
        ImGui::SetCursorPos({at.x + 12 * s, at.y + 5 * s});
        ImGui::PushFont(fonts().heading);
        ImGui::TextUnformatted(entry.name.c_str());
        ImGui::PopFont();
        ImGui::SetCursorPos({at.x + 12 * s, at.y + 25 * s});
        ImGui::PushFont(fonts().small);
        ImGui::TextDisabled("%s", entry.folder.c_str());
        const std::string right =
            text("%.1f MB", entry.megabytes) + (entry.recent ? "   recent" : "");
        ImGui::SetCursorPos(
            {width - 2 * pad - ImGui::CalcTextSize(right.c_str()).x - 10 * s, at.y + 15 * s});
        ImGui::TextDisabled("%s", right.c_str());
        ImGui::PopFont();
        ImGui::SetCursorPos({at.x, at.y + row + 4 * s});
        ImGui::PopID();
    }
    ImGui::EndGroup();
    ImGui::EndChild();
    ImGui::Dummy({0, 4 * s});
    ImGui::SetNextItemWidth(width - 96 * s);
    const bool entered =
        ImGui::InputTextWithHint("##path", "Path of a *.sonocase file", app.bundle_path,
                                 sizeof app.bundle_path, ImGuiInputTextFlags_EnterReturnsTrue);
    ImGui::SameLine();
    if ((ImGui::Button("Open", {-1, 0}) || entered) && app.bundle_path[0]) {
        open_bundle(app, app.bundle_path, "");
    }
    ImGui::TextDisabled("Arrow keys and Enter choose.  F1 help.  Ctrl+Q quits.");
    ImGui::EndChild();
}

void draw_top_bar(App& app, float height) {
    const float s = app.window->scale();
    ImGui::BeginChild("bar", {0, height}, false, ImGuiWindowFlags_NoScrollbar);
    ImGui::SetCursorPos({10 * s, 0.5f * (height - ImGui::GetFrameHeight())});
    ImGui::PushFont(fonts().heading);
    ImGui::AlignTextToFramePadding();
    ImGui::TextColored(ImGui::ColorConvertU32ToFloat4(colour::kAccent), "sonocase");
    ImGui::PopFont();
    ImGui::SameLine(0, 14 * s);
    if (ImGui::Button("Cases")) {
        app.bundles = find_bundles(app.settings);
        app.page = Page::bundles;
    }
    ImGui::SameLine();
    ImGui::SetNextItemWidth(250 * s);
    if (ImGui::BeginCombo("##exercise", app.current().title.empty()
                                            ? app.current().name.c_str()
                                            : app.current().title.c_str())) {
        for (std::size_t i = 0; i < app.open->exercises.size(); ++i) {
            const Exercise& e = app.open->exercises[i];
            const std::string label = (e.title.empty() ? e.name : e.title) + "##" + e.name;
            if (ImGui::Selectable(label.c_str(), static_cast<int>(i) == app.exercise)) {
                choose_exercise(app, static_cast<int>(i));
            }
        }
        ImGui::EndCombo();
    }
    ImGui::SameLine();
    ImGui::SetNextItemWidth(96 * s);
    if (ImGui::BeginCombo("##model", app.model == "paper" ? "Paper" : "Physical")) {
        for (const char* model : {"physical", "paper"}) {
            if (ImGui::Selectable(model[1] == 'a' ? "Paper" : "Physical", app.model == model)) {
                app.model = model;
                rebuild_engine(app);
            }
        }
        ImGui::EndCombo();
    }
    ImGui::SameLine();
    if (ImGui::Button("Set-up")) app.show_setup = !app.show_setup;
    ImGui::SameLine();
    if (ImGui::Button("Help")) app.show_help = !app.show_help;

    // Health on the right: what an instructor looks for first when something feels wrong.
    const TrackerHealth health = app.scan->tracker_health();
    const ScanFrame& frame = app.frame();
    const std::string latency =
        frame.pose_to_pixel_median_ms > 0
            ? text("pose to pixels %.1f ms", frame.pose_to_pixel_median_ms) +
                  text(" (99%%: %.1f)", frame.pose_to_pixel_p99_ms)
            : "no pose yet";
    const std::string rate = text("%.0f fps", app.ui_rate);
    const float wide = ImGui::CalcTextSize(health.device.c_str()).x +
                       ImGui::CalcTextSize(latency.c_str()).x +
                       ImGui::CalcTextSize(rate.c_str()).x + 70 * s;
    ImGui::SameLine(std::max(ImGui::GetCursorPosX() + 10, ImGui::GetWindowWidth() - wide));
    ImGui::AlignTextToFramePadding();
    dot(phase_colour(health.phase));
    ImGui::TextUnformatted(health.device.c_str());
    ImGui::SameLine(0, 18 * s);
    ImGui::TextDisabled("%s", latency.c_str());
    ImGui::SameLine(0, 18 * s);
    ImGui::TextDisabled("%s", rate.c_str());
    ImGui::EndChild();
}

void draw_scan_page(App& app) {
    const float s = app.window->scale(), gap = 6 * s;
    ImGui::PushStyleVar(ImGuiStyleVar_ItemSpacing, {gap, gap});
    const float bar = 38 * s;
    draw_top_bar(app, bar);
    const ImVec2 area = ImGui::GetContentRegionAvail();
    const float side = std::clamp(0.205f * area.x, 232 * s, 300 * s);
    const bool left = app.settings.show_exercise || app.settings.show_tracker;
    if (left) {
        ImGui::BeginChild("left", {side, 0}, false, ImGuiWindowFlags_NoBackground);
        if (app.settings.show_exercise) {
            const float share = app.settings.show_tracker ? 0.5f * (area.y - gap) : area.y;
            ImGui::BeginChild("exercise", {0, share}, false,
                              ImGuiWindowFlags_AlwaysUseWindowPadding);
            ImGui::PushStyleVar(ImGuiStyleVar_ItemSpacing, {7 * s, 5 * s});
            draw_exercise_panel(app);
            ImGui::PopStyleVar();
            ImGui::EndChild();
        }
        if (app.settings.show_tracker) {
            ImGui::BeginChild("tracker", {0, 0}, false, ImGuiWindowFlags_AlwaysUseWindowPadding);
            ImGui::PushStyleVar(ImGuiStyleVar_ItemSpacing, {7 * s, 5 * s});
            draw_tracker_panel(app);
            ImGui::PopStyleVar();
            ImGui::EndChild();
        }
        ImGui::EndChild();
        ImGui::SameLine();
    }
    const float right = std::clamp(0.225f * area.x, 262 * s, 340 * s);
    const float middle = area.x - right - gap - (left ? side + gap : 0);
    ImGui::BeginChild("middle", {middle, 0}, false, ImGuiWindowFlags_NoBackground);
    const float cine = app.controls.frozen ? 34 * s : 0;
    const ImVec2 room = ImGui::GetContentRegionAvail();
    const int wanted =
        std::clamp(static_cast<int>(std::min(room.x, room.y - cine) / 128) * 128, 512, 1024);
    if (wanted != app.render_px && app.arguments.width_px == 0 && !app.controls.frozen) {
        app.render_px = wanted;
        rebuild_engine(app);
    }
    ImageViewInput input;
    input.frame = &app.frame();
    input.texture = app.texture->empty() ? nullptr : app.texture->id();
    input.probe = &app.current().probe;
    input.flipped = app.controls.settings.flip_left_right;
    input.measuring = app.measuring;
    input.scale = s;
    const ImageSettings& image = app.controls.settings;
    const Probe& probe = app.current().probe;
    input.left_lines = {
        app.open->bundle->manifest.case_name,
        std::string(shape_name(probe.shape)) + text("  %.1f MHz", probe.frequency_mhz),
        text("Depth %.1f cm", app.depth_mm / 10), text("Focus %.1f cm", app.focus_mm / 10)};
    input.right_lines = {text("Gain %+.0f dB", image.gain_db),
                         text("DR %.0f dB", image.dynamic_range_db),
                         text("%.0f frames/s", app.frame().frames_per_s)};
    if (app.measuring) input.right_lines.push_back("Measure: click two points");
    app.image.draw(room.x, room.y - cine - (cine > 0 ? gap : 0), input);
    handle_picture_mouse(app);
    if (app.controls.frozen) {
        ImGui::BeginChild("cine", {0, cine}, false);
        ImGui::SetCursorPos({8 * s, 0.5f * (cine - ImGui::GetFrameHeight())});
        if (ImGui::Button(app.playing_cine ? "Stop" : "Play", {54 * s, 0})) {
            app.playing_cine = !app.playing_cine;
        }
        ImGui::SameLine();
        const int count = std::max(app.frame().cine_frames - 1, 1);
        int at = count - app.cine_back;
        ImGui::SetNextItemWidth(ImGui::GetContentRegionAvail().x - 78 * s);
        if (ImGui::SliderInt("##cine", &at, 0, count, "")) {
            app.cine_back = app.controls.cine_back = count - at;
            app.playing_cine = false;
        }
        ImGui::SameLine();
        ImGui::AlignTextToFramePadding();
        ImGui::TextDisabled("-%.2f s", app.frame().cine_age_s);
        ImGui::EndChild();
    }
    ImGui::EndChild();
    ImGui::SameLine();
    ImGui::BeginChild("right", {right, 0}, false, ImGuiWindowFlags_NoBackground);
    if (app.settings.show_3d) draw_view3d_panel(app, std::min(0.34f * area.y, 0.8f * right));
    const float rest = ImGui::GetContentRegionAvail().y;
    const float console = app.settings.show_effects ? std::min(0.66f * rest, 318 * s) : rest;
    ImGui::BeginChild("console", {0, console}, false, ImGuiWindowFlags_AlwaysUseWindowPadding);
    ImGui::PushStyleVar(ImGuiStyleVar_ItemSpacing, {7 * s, 5 * s});
    draw_console_panel(app);
    ImGui::PopStyleVar();
    ImGui::EndChild();
    if (app.settings.show_effects) {
        ImGui::BeginChild("effects", {0, 0}, false, ImGuiWindowFlags_AlwaysUseWindowPadding);
        ImGui::PushStyleVar(ImGuiStyleVar_ItemSpacing, {7 * s, 4 * s});
        draw_effects_panel(app);
        ImGui::PopStyleVar();
        ImGui::EndChild();
    }
    ImGui::EndChild();
    ImGui::PopStyleVar();
}

}  // namespace sonocase::runtime
