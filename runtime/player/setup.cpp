// SPDX-License-Identifier: Apache-2.0

// Guided set-up: the window of setup_guide.h.
#include <imgui.h>

#include <algorithm>
#include <cstdio>
#include <filesystem>

#include "formats/files/calibration_file.h"
#include "runtime/display/theme.h"
#include "runtime/player/app.h"

namespace sonocase::runtime {
namespace {

void sensor_choice(const char* tool, int& index, const TrackerReading& reading) {
    ImGui::PushID(tool);
    ImGui::AlignTextToFramePadding();
    ImGui::TextUnformatted(tool);
    ImGui::SameLine(90 * ImGui::GetFontSize() / 14);
    char shown[32] = "none";
    if (index >= 0) std::snprintf(shown, sizeof shown, "Sensor %d", index + 1);
    ImGui::SetNextItemWidth(140 * ImGui::GetFontSize() / 14);
    if (ImGui::BeginCombo("##sensor", shown)) {
        for (int i = -1; i < std::max(reading.sensor_count, 2); ++i) {
            char name[32] = "none";
            if (i >= 0) std::snprintf(name, sizeof name, "Sensor %d", i + 1);
            if (ImGui::Selectable(name, i == index)) index = i;
        }
        ImGui::EndCombo();
    }
    ImGui::SameLine();
    if (index >= 0 && index < reading.sensor_count) {
        const SensorReading& s = reading.sensors[static_cast<std::size_t>(index)];
        const Vector3 t = s.world_from_sensor.translation;
        ImGui::TextDisabled("%8.1f %8.1f %8.1f mm", t.x, t.y, t.z);
    } else {
        ImGui::TextDisabled("no readings");
    }
    ImGui::PopID();
}

void save_all(App& app) {
    std::string folder = data_folder();
    if (folder.empty()) {
        notify(app, Notice::Kind::error,
               "There is no folder to save to: set HOME or XDG_DATA_HOME.");
        return;
    }
    folder += "/calibrations";
    std::error_code failed;
    std::filesystem::create_directories(folder, failed);
    app.settings.calibrations.clear();
    for (const auto* calibration :
         {&app.calibrations.probe, &app.calibrations.needle, &app.calibrations.mannequin}) {
        if (!*calibration) continue;
        const std::string path = folder + "/" + (*calibration)->kind + ".json";
        const Status saved = save_calibration(**calibration, path);
        if (!saved) {
            notify(app, Notice::Kind::error, saved.error().message());
            return;
        }
        app.settings.calibrations.push_back(path);
    }
    notify(app, Notice::Kind::news, "Saved in " + folder + ".");
    app.show_setup = false;
}

void draw_step(App& app, SetupGuide& guide) {
    const float s = app.window->scale();
    const TrackerReading& reading = app.frame().reading;
    const SetupView& view = guide.view();
    ImGui::PushFont(fonts().heading);
    ImGui::TextUnformatted(setup_title(guide.step()));
    ImGui::PopFont();
    ImGui::TextWrapped("%s", setup_instruction(guide.step()));
    ImGui::Dummy({0, 4 * s});
    if (reading.in_mannequin) {
        ImGui::PushStyleColor(ImGuiCol_Text, colour::kWarn);
        ImGui::TextWrapped(
            "The mouse and scripts need no set-up. Choose a tracker that measures first.");
        ImGui::PopStyleColor();
        return;
    }
    if (guide.step() == SetupStep::trackers) {
        const TrackerHealth health = app.scan->tracker_health();
        ImGui::Text("%s: %s, %.0f readings a second", health.device.c_str(),
                    phase_name(health.phase), health.rate_hz);
        if (!health.message.empty()) ImGui::TextWrapped("%s", health.message.c_str());
        ImGui::Dummy({0, 4 * s});
        sensor_choice("Probe", app.controls.assignment.probe, reading);
        sensor_choice("Needle", app.controls.assignment.needle, reading);
        return;
    }
    if (guide.step() == SetupStep::done) {
        const char* words[] = {"Probe", "Needle", "Mannequin"};
        const std::optional<Calibration>* all[] = {
            &app.calibrations.probe, &app.calibrations.needle, &app.calibrations.mannequin};
        for (int i = 0; i < 3; ++i) {
            if (*all[i]) {
                ImGui::Text("%s: rms %.2f mm, %d readings", words[i], (*all[i])->rms_mm,
                            (*all[i])->poses);
            } else {
                ImGui::TextDisabled("%s: not calibrated", words[i]);
            }
        }
        ImGui::Dummy({0, 6 * s});
        if (ImGui::Button("Save", {140 * s, 0})) save_all(app);
        return;
    }
    const bool on = guide.recording();
    ImGui::PushStyleColor(ImGuiCol_Button,
                          on ? colour::rgba(150, 58, 54) : colour::rgba(32, 112, 92));
    if (ImGui::Button(on ? "Stop" : "Record", {140 * s, 0})) guide.record(!on);
    ImGui::PopStyleColor();
    ImGui::SameLine();
    if (ImGui::Button("Clear", {80 * s, 0})) guide.clear_step();
    ImGui::SameLine();
    ImGui::TextDisabled("%d readings", view.readings);
    if (guide.step() == SetupStep::needle) {
        ImGui::SameLine();
        ImGui::TextDisabled("%d depths", view.recordings);
    }
    ImGui::TextDisabled("Coverage");
    ImGui::SameLine(90 * s);
    ImGui::ProgressBar(static_cast<float>(view.coverage), {-1, 12 * s}, "");
    if (view.rms_mm >= 0) {
        ImGui::TextDisabled("Residual");
        ImGui::SameLine(90 * s);
        ImGui::Text("%.2f mm", view.rms_mm);
        if (view.sigma_mm >= 0) {
            ImGui::SameLine();
            ImGui::TextDisabled("one standard deviation %.2f mm", view.sigma_mm);
        }
        if (!view.residuals_mm.empty()) {
            ImGui::PlotLines("##residuals", view.residuals_mm.data(),
                             static_cast<int>(view.residuals_mm.size()), 0, nullptr, 0, 5,
                             {-1, 70 * s});
        }
    }
    ImGui::PushStyleColor(ImGuiCol_Text, view.good_enough ? colour::kGood : colour::kText);
    if (!view.sentence.empty()) ImGui::TextWrapped("%s", view.sentence.c_str());
    ImGui::PopStyleColor();
}

}  // namespace

void draw_setup(App& app) {
    if (!app.guide) app.guide = std::make_unique<SetupGuide>(*app.open->bundle);
    SetupGuide& guide = *app.guide;
    guide.observe(app.frame().reading, app.controls.assignment, app.now_s);
    // What is known already is in use at once, so that the picture shows it.
    const Calibrations found = guide.calibrations(app.scan->tracker_health().device, utc_now());
    const auto take = [](std::optional<Calibration>& in_use,
                         const std::optional<Calibration>& fresh) {
        if (fresh) in_use = fresh;
    };
    if (!guide.recording() && (found.probe || found.needle || found.mannequin)) {
        take(app.calibrations.probe, found.probe);
        take(app.calibrations.needle, found.needle);
        take(app.calibrations.mannequin, found.mannequin);
        app.scan->set_calibrations(app.calibrations);
    }
    const float s = app.window->scale();
    const ImGuiIO& io = ImGui::GetIO();
    ImGui::SetNextWindowPos({0.5f * io.DisplaySize.x, 0.5f * io.DisplaySize.y}, ImGuiCond_Appearing,
                            {0.5f, 0.5f});
    ImGui::SetNextWindowSize({690 * s, 390 * s}, ImGuiCond_Appearing);
    ImGui::PushStyleVar(ImGuiStyleVar_WindowRounding, 7 * s);
    ImGui::PushStyleVar(ImGuiStyleVar_WindowBorderSize, 1);
    ImGui::PushStyleColor(ImGuiCol_WindowBg, colour::rgba(24, 29, 36, 252));
    ImGui::PushStyleColor(ImGuiCol_TitleBgActive, colour::rgba(30, 37, 46));
    if (ImGui::Begin("Set-up", &app.show_setup,
                     ImGuiWindowFlags_NoCollapse | ImGuiWindowFlags_NoSavedSettings)) {
        const float bottom = -ImGui::GetFrameHeightWithSpacing() - 4 * s;
        ImGui::BeginChild("steps", {190 * s, bottom}, false, ImGuiWindowFlags_NoBackground);
        for (int i = 0; i < kSetupSteps; ++i) {
            const auto step = static_cast<SetupStep>(i);
            char label[64];
            std::snprintf(label, sizeof label, "%d  %s", i + 1, setup_title(step));
            if (ImGui::Selectable(label, step == guide.step(), 0, {0, 24 * s})) guide.go_to(step);
        }
        ImGui::EndChild();
        ImGui::SameLine();
        ImGui::BeginChild("step", {0, bottom}, false, ImGuiWindowFlags_NoBackground);
        draw_step(app, guide);
        ImGui::EndChild();
        ImGui::SetCursorPosX(ImGui::GetWindowWidth() - 112 * s);
        if (guide.step() != SetupStep::done && ImGui::Button("Next", {100 * s, 0})) guide.next();
    }
    ImGui::End();
    ImGui::PopStyleColor(2);
    ImGui::PopStyleVar(2);
}

}  // namespace sonocase::runtime
