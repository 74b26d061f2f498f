// SPDX-License-Identifier: Apache-2.0

// The guided set-up (runtime/player/app/setup_guide.h) as a window, with a drawing per step: what
// is held where, and how it moves.

#include <algorithm>
#include <cmath>
#include <cstdio>

#include <imgui.h>

#include "runtime/display/theme.h"
#include "runtime/player/ui/panels.h"
#include "runtime/player/ui/parts/icons.h"
#include "runtime/player/ui/parts/panel_parts.h"
#include "runtime/player/words/words.h"

namespace sonocase::runtime::inline player_ui {

namespace {

constexpr float kWide = 300, kHigh = 110;  // u

struct Pen {
    ImDrawList* draw;
    ImVec2 at;
    float s;

    ImVec2 point(float x, float y) const { return {at.x + x * s, at.y + y * s}; }
    void line(float x0, float y0, float x1, float y1, unsigned packed, float thick = 2) const {
        draw->AddLine(point(x0, y0), point(x1, y1), packed, thick * s);
    }
    void arrow(float x0, float y0, float x1, float y1) const {
        line(x0, y0, x1, y1, colour::kAccent);
        const float dx = x1 - x0, dy = y1 - y0, n = std::max(std::hypot(dx, dy), 1.0f);
        const float ux = dx / n, uy = dy / n;
        line(x1, y1, x1 - 8 * ux - 5 * uy, y1 - 8 * uy + 5 * ux, colour::kAccent);
        line(x1, y1, x1 - 8 * ux + 5 * uy, y1 - 8 * uy - 5 * ux, colour::kAccent);
    }
    // A probe whose face's middle is at x, y, leaning by so much per unit of height.
    void probe(float x, float y, float lean, unsigned packed) const {
        const ImVec2 shape[] = {point(x - 18, y - 4),
                                point(x + 18, y - 4),
                                point(x + 12 + 34 * lean, y - 40),
                                point(x + 9 + 58 * lean, y - 64),
                                point(x - 9 + 58 * lean, y - 64),
                                point(x - 12 + 34 * lean, y - 40)};
        draw->AddPolyline(shape, 6, packed, ImDrawFlags_Closed, 2 * s);
        line(x - 18, y - 4, x, y, packed);
        line(x, y, x + 18, y - 4, packed);
    }
    void ruler(float x, float y, float length, bool upright) const {
        for (int i = 0; i <= 12; ++i) {
            const float t = length * static_cast<float>(i) / 12, tick = i % 4 == 0 ? 10.0f : 5.0f;
            if (upright) {
                line(x, y + t, x + tick, y + t, colour::kDim, 1);
            } else {
                line(x + t, y, x + t, y + tick, colour::kDim, 1);
            }
        }
        line(x, y, upright ? x : x + length, upright ? y + length : y, colour::kDim, 1);
    }
};

void draw_needle_step(const Pen& pen) {
    pen.line(40, 84, 140, 84, colour::kDim);
    pen.line(160, 84, 260, 84, colour::kDim);  // a plate with a pinhole
    for (const float lean : {-36.0f, 0.0f, 36.0f})
        pen.line(150 - 0.3f * lean, 104, 150 + lean, 10,
                 lean == 0 ? colour::kText : colour::kFaint);
    pen.arrow(176, 30, 196, 42);
    pen.arrow(226, 60, 226, 100);
}

void draw_sweep_step(const Pen& pen) {
    pen.draw->PathLineTo(pen.point(20, 104));
    pen.draw->PathBezierCubicCurveTo(pen.point(60, 40), pen.point(240, 40), pen.point(280, 104),
                                     24);
    pen.draw->PathStroke(colour::kDim, 0, 2 * pen.s);
    pen.probe(150, 58, 0, colour::kText);
    pen.arrow(120, 76, 64, 92);
    pen.arrow(180, 76, 236, 92);
}

}  // namespace

void draw_setup_drawing(SetupStep step, float s) {
    const Pen pen{ImGui::GetWindowDrawList(), ImGui::GetCursorScreenPos(), s};
    pen.draw->AddRectFilled(pen.at, pen.point(kWide, kHigh), colour::kRaised, 6 * s);
    switch (step) {
        case SetupStep::trackers:
            pen.probe(90, 92, 0, colour::kText);
            pen.line(200, 96, 236, 26, colour::kText);
            pen.draw->AddCircle(pen.point(90, 20), 8 * s, colour::kAccent, 20, 2 * s);
            pen.draw->AddCircle(pen.point(236, 22), 8 * s, colour::kAccent, 20, 2 * s);
            break;
        case SetupStep::probe_tip:
            pen.probe(150, 86, -0.7f, colour::kFaint);
            pen.probe(150, 86, 0.7f, colour::kFaint);
            pen.probe(150, 86, 0, colour::kText);
            pen.line(150, 87, 150, 106, colour::kDim);  // the pin
            pen.arrow(176, 18, 204, 34);
            pen.arrow(124, 18, 96, 34);
            break;
        case SetupStep::probe_depth:
            pen.probe(130, 78, 0, colour::kText);
            pen.ruler(176, 6, 96, true);
            pen.arrow(130, 82, 130, 106);
            break;
        case SetupStep::probe_lateral:
            pen.probe(120, 82, 0, colour::kText);
            pen.draw->AddCircleFilled(pen.point(136, 60), 3 * s, colour::kAccent);  // its mark
            pen.ruler(30, 92, 240, false);
            pen.arrow(150, 52, 214, 52);
            break;
        case SetupStep::needle: draw_needle_step(pen); break;
        case SetupStep::mannequin: draw_sweep_step(pen); break;
        case SetupStep::done:
            pen.probe(90, 92, 0, colour::kText);
            pen.draw->AddTriangle(pen.point(220, 20), pen.point(180, 96), pen.point(260, 96),
                                  colour::kDim, 2 * s);
            pen.arrow(118, 60, 176, 60);
            break;
    }
    ImGui::Dummy({kWide * s, kHigh * s});
}

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
        const SensorReading& s = reading.sensors[index];
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
    if (!tracker.message.empty()) ImGui::TextWrapped("%s", tr_message(tracker.message).c_str());
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

}  // namespace sonocase::runtime::inline player_ui
