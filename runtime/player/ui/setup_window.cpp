// SPDX-License-Identifier: Apache-2.0

// The guided set-up (runtime/player/app/setup_guide.h) as a window.
#include <imgui.h>

#include <algorithm>
#include <cstdio>

#include "runtime/player/ui/panel_parts.h"
#include "runtime/player/ui/panels.h"

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

void draw_sensors(const TrackerHealth& tracker,
                  const TrackerReading& reading,
                  SensorAssignment& assignment,
                  float s) {
    ImGui::Text("%s: %s, %.0f readings per second", tracker.device.c_str(),
                phase_name(tracker.phase), tracker.rate_hz);
    if (!tracker.message.empty()) ImGui::TextWrapped("%s", tracker.message.c_str());
    ImGui::Dummy({0, 4 * s});
    sensor_choice("Probe", assignment.probe, reading);
    sensor_choice("Needle", assignment.needle, reading);
}

// True: save.
bool draw_summary(const Calibrations& calibrations, float s) {
    const std::pair<const char*, const std::optional<Calibration>*> tools[] = {
        {"Probe", &calibrations.probe},
        {"Needle", &calibrations.needle},
        {"Mannequin", &calibrations.mannequin}};
    for (const auto& [name, calibration] : tools) {
        if (*calibration) {
            ImGui::Text("%s: rms %.2f mm, %d readings", name, (*calibration)->rms_mm,
                        (*calibration)->poses);
        } else {
            ImGui::TextDisabled("%s: not calibrated", name);
        }
    }
    ImGui::Dummy({0, 6 * s});
    return ImGui::Button("Save", {140 * s, 0});
}

void draw_recording(SetupGuide& guide, float s) {
    const SetupView& view = guide.view();
    const bool on = guide.recording();
    if (coloured_button(on ? colour::rgba(150, 58, 54) : colour::rgba(32, 112, 92),
                        on ? "Stop" : "Record", 140 * s))
        guide.record(!on);
    ImGui::SameLine();
    if (ImGui::Button("Clear", {80 * s, 0})) guide.clear_step();
    ImGui::SameLine();
    ImGui::TextDisabled("%d readings", view.readings);
    if (guide.step() == SetupStep::needle) {
        ImGui::SameLine();
        ImGui::TextDisabled("%d depths", view.recordings);
    }
}

void draw_fit(const SetupView& view, float s) {
    ImGui::TextDisabled("Coverage");
    ImGui::SameLine(90 * s);
    ImGui::ProgressBar(static_cast<float>(view.coverage), {-1, 12 * s}, "");
    if (view.rms_mm >= 0) {
        ImGui::TextDisabled("Residual");
        ImGui::SameLine(90 * s);
        ImGui::Text("%.2f mm", view.rms_mm);
        if (view.sigma_mm >= 0) {
            ImGui::SameLine();
            ImGui::TextDisabled("standard deviation %.2f mm", view.sigma_mm);
        }
        if (!view.residuals_mm.empty()) {
            ImGui::PlotLines("##residuals", view.residuals_mm.data(),
                             static_cast<int>(view.residuals_mm.size()), 0, nullptr, 0, 5,
                             {-1, 70 * s});
        }
    }
    if (!view.sentence.empty())
        coloured(view.good_enough ? colour::kGood : colour::kText, view.sentence);
}

void draw_steps(SetupGuide& guide, float s) {
    for (int i = 0; i < kSetupSteps; ++i) {
        const auto step = static_cast<SetupStep>(i);
        char label[64];
        std::snprintf(label, sizeof label, "%d  %s", i + 1, setup_title(step));
        if (ImGui::Selectable(label, step == guide.step(), 0, {0, 24 * s})) guide.go_to(step);
    }
}

}  // namespace

bool draw_setup_window(SetupGuide& guide,
                       const TrackerHealth& tracker,
                       const TrackerReading& reading,
                       const Calibrations& calibrations,
                       SensorAssignment& assignment,
                       bool& open,
                       float s) {
    bool save = false;
    if (begin_dialog("Set-up", open, 690 * s, 390 * s, s)) {
        const float bottom = -ImGui::GetFrameHeightWithSpacing() - 4 * s;
        ImGui::BeginChild("steps", {190 * s, bottom}, false, ImGuiWindowFlags_NoBackground);
        draw_steps(guide, s);
        ImGui::EndChild();
        ImGui::SameLine();
        ImGui::BeginChild("step", {0, bottom}, false, ImGuiWindowFlags_NoBackground);
        heading(setup_title(guide.step()));
        ImGui::TextWrapped("%s", setup_instruction(guide.step()));
        ImGui::Dummy({0, 4 * s});
        if (reading.in_mannequin) {
            coloured(colour::kWarn,
                     "The mouse and scripts need no set-up. Choose a tracker that measures first.");
        } else if (guide.step() == SetupStep::trackers) {
            draw_sensors(tracker, reading, assignment, s);
        } else if (guide.step() == SetupStep::done) {
            save = draw_summary(calibrations, s);
        } else {
            draw_recording(guide, s);
            draw_fit(guide.view(), s);
        }
        ImGui::EndChild();
        ImGui::SetCursorPosX(ImGui::GetWindowWidth() - 112 * s);
        if (guide.step() != SetupStep::done && ImGui::Button("Next", {100 * s, 0})) guide.next();
    }
    end_dialog();
    return save;
}

}  // namespace sonocase::runtime
