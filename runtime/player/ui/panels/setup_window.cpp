// SPDX-License-Identifier: Apache-2.0

// The guided set-up (runtime/player/app/set_up/setup_guide.h) as a window.
#include <imgui.h>

#include <algorithm>
#include <cstdio>

#include "runtime/player/ui/panels/panels.h"
#include "runtime/player/ui/parts/icons.h"
#include "runtime/player/ui/parts/panel_parts.h"
#include "runtime/player/words/said.h"
#include "runtime/player/words/words.h"

namespace sonocase::runtime {
namespace {

constexpr double kStepSeconds = 15;  // that most steps take

// "Polhemus Viper 2": the device by its name, and the number on its socket.
std::string sensor_name(const std::string& device, int index) {
    if (index < 0) return tr("none");
    return (device.empty() ? std::string(tr("Sensor")) : device) + " " + std::to_string(index + 1);
}

void sensor_choice(const char* tool,
                   const std::string& device,
                   int& index,
                   const TrackerReading& reading) {
    ImGui::PushID(tool);
    ImGui::AlignTextToFramePadding();
    ImGui::TextUnformatted(tr(tool));
    ImGui::SameLine(90 * ImGui::GetFontSize() / 14);
    ImGui::SetNextItemWidth(170 * ImGui::GetFontSize() / 14);
    if (ImGui::BeginCombo("##sensor", sensor_name(device, index).c_str())) {
        for (int i = -1; i < std::max(reading.sensor_count, 2); ++i) {
            if (ImGui::Selectable(sensor_name(device, i).c_str(), i == index)) index = i;
        }
        ImGui::EndCombo();
    }
    ImGui::SameLine();
    if (index >= 0 && index < reading.sensor_count) {
        const SensorReading& s = reading.sensors[static_cast<std::size_t>(index)];
        const Vector3 t = s.world_from_sensor.translation;
        ImGui::TextDisabled("%8.1f %8.1f %8.1f mm", t.x, t.y, t.z);
    } else {
        ImGui::TextDisabled("%s", tr("no readings"));
    }
    ImGui::PopID();
}

void draw_sensors(const TrackerHealth& tracker,
                  const TrackerReading& reading,
                  SensorAssignment& assignment,
                  float s) {
    ImGui::Text(tr("%s: %s, %.0f readings per second"), tracker.device.c_str(),
                tr(phase_name(tracker.phase)), tracker.rate_hz);
    if (!tracker.message.empty()) ImGui::TextWrapped("%s", tr_said(tracker.message).c_str());
    ImGui::Dummy({0, 4 * s});
    sensor_choice("Probe", tracker.device, assignment.probe, reading);
    sensor_choice("Needle", tracker.device, assignment.needle, reading);
}

// True: save.
bool draw_summary(const Calibrations& calibrations, float s) {
    const std::pair<const char*, const std::optional<Calibration>*> tools[] = {
        {"Probe", &calibrations.probe},
        {"Needle", &calibrations.needle},
        {"Mannequin", &calibrations.mannequin}};
    for (const auto& [name, calibration] : tools) {
        if (*calibration) {
            ImGui::Text(tr("%s: rms %.2f mm, %d readings"), tr(name), (*calibration)->rms_mm,
                        (*calibration)->poses);
        } else {
            ImGui::TextDisabled(tr("%s: not calibrated"), tr(name));
        }
    }
    ImGui::Dummy({0, 6 * s});
    return ImGui::Button(tr("Save"), {140 * s, 0});
}

void draw_recording(SetupGuide& guide, float s) {
    const SetupView& view = guide.view();
    const bool on = guide.recording();
    if (coloured_button(on ? colour::kControlPressed : colour::kPrime, tr(on ? "Stop" : "Record"),
                        140 * s))
        guide.record(!on);
    ImGui::SameLine();
    if (ImGui::Button(tr("Clear"), {80 * s, 0})) guide.clear_step();
    ImGui::SameLine();
    ImGui::TextDisabled(tr("%d readings, %.0f of about %.0f s"), view.readings, view.seconds,
                        kStepSeconds);
    if (guide.step() == SetupStep::needle) {
        ImGui::SameLine();
        ImGui::TextDisabled(tr("%d depths"), view.recordings);
    }
}

// The residuals of the newest readings as a curve, up to 5 mm.
void draw_course(const std::vector<float>& residuals_mm, float s) {
    const ImVec2 at = ImGui::GetCursorScreenPos();
    const ImVec2 size{ImGui::GetContentRegionAvail().x, 70 * s};
    ImDrawList* draw = ImGui::GetWindowDrawList();
    draw->AddRectFilled(at, {at.x + size.x, at.y + size.y}, colour::kRaised, 4 * s);
    const float step =
        residuals_mm.size() > 1 ? size.x / static_cast<float>(residuals_mm.size() - 1) : 0;
    float x = at.x;
    for (const float mm : residuals_mm) {
        draw->PathLineTo({x, at.y + size.y * (1 - std::clamp(mm / 5, 0.0f, 1.0f))});
        x += step;
    }
    draw->PathStroke(colour::kAccent, 0, 2 * s);
    ImGui::Dummy(size);
}

void draw_fit(const SetupView& view, float s) {
    ImGui::TextDisabled("%s", tr("Coverage"));
    ImGui::SameLine(90 * s);
    ImGui::ProgressBar(static_cast<float>(view.coverage), {-1, 12 * s}, "");
    if (view.rms_mm >= 0) {
        ImGui::TextDisabled("%s", tr("Residual"));
        ImGui::SameLine(90 * s);
        ImGui::Text("%.2f mm", view.rms_mm);
        if (view.sigma_mm >= 0) {
            ImGui::SameLine();
            ImGui::TextDisabled(tr("standard deviation %.2f mm"), view.sigma_mm);
        }
        if (!view.residuals_mm.empty()) {
            draw_course(view.residuals_mm, s);
        }
    }
    if (!view.sentence.empty())
        coloured(view.good_enough ? colour::kGood : colour::kText, view.sentence);
}

void draw_steps(SetupGuide& guide, float s) {
    for (int i = 0; i < kSetupSteps; ++i) {
        const auto step = static_cast<SetupStep>(i);
        char label[64];
        std::snprintf(label, sizeof label, "%d  %s", i + 1, tr(setup_title(step)));
        const ImVec2 at = ImGui::GetCursorScreenPos();
        if (ImGui::Selectable(label, step == guide.step(), 0, {0, 24 * s})) guide.go_to(step);
        if (guide.found(step))  // a tick at the end of its row
            draw_icon(ImGui::GetWindowDrawList(), Icon::check, at.x + 206 * s, at.y + 2 * s, 18 * s,
                      colour::kGood);
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
    if (begin_dialog(tr("Set-up"), open, 760 * s, 520 * s, s)) {
        const float bottom = -ImGui::GetFrameHeightWithSpacing() - 4 * s;
        ImGui::BeginChild("steps", {235 * s, bottom}, false, ImGuiWindowFlags_NoBackground);
        draw_steps(guide, s);
        ImGui::EndChild();
        ImGui::SameLine();
        ImGui::BeginChild("step", {0, bottom}, false, ImGuiWindowFlags_NoBackground);
        heading(setup_title(guide.step()));
        draw_setup_drawing(guide.step(), s);
        ImGui::TextWrapped("%s", tr(setup_instruction(guide.step())));
        ImGui::Dummy({0, 4 * s});
        if (reading.in_mannequin) {
            coloured(colour::kWarn,
                     tr("The mouse and scripts need no set-up. Choose a tracker that measures "
                        "first."));
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
        if (guide.step() != SetupStep::done && ImGui::Button(tr("Next"), {100 * s, 0}))
            guide.next();
    }
    end_dialog();
    return save;
}

}  // namespace sonocase::runtime
