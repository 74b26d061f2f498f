// SPDX-License-Identifier: Apache-2.0

// The panels at the sides of the picture.
#include <imgui.h>

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "formats/exercise/metric_table.h"
#include "runtime/display/theme.h"
#include "runtime/player/app.h"

namespace sonocase::runtime {
namespace {

void heading(const char* words) {
    ImGui::PushFont(fonts().heading);
    ImGui::TextUnformatted(words);
    ImGui::PopFont();
}

void coloured(unsigned packed, const std::string& words) {
    ImGui::PushStyleColor(ImGuiCol_Text, packed);
    ImGui::TextWrapped("%s", words.c_str());
    ImGui::PopStyleColor();
}

// A name on the left and a value at the right edge.
void row(const char* name, const char* value, unsigned packed = colour::kText) {
    ImGui::TextDisabled("%s", name);
    ImGui::SameLine(ImGui::GetWindowContentRegionMax().x - ImGui::CalcTextSize(value).x);
    ImGui::PushStyleColor(ImGuiCol_Text, packed);
    ImGui::TextUnformatted(value);
    ImGui::PopStyleColor();
}

void row(const char* name, const char* format, double number, unsigned packed = colour::kText) {
    char value[48];
    std::snprintf(value, sizeof value, format, number);
    row(name, value, packed);
}

void row_distance(const char* name, double mm, double good_mm) {
    row(name, "%.1f mm", mm, mm <= good_mm ? colour::kGood : colour::kText);
}

bool slider(
    const char* name, const char* id, double& value, double low, double high, const char* format) {
    const float s = ImGui::GetFontSize() / 14;
    ImGui::AlignTextToFramePadding();
    ImGui::TextDisabled("%s", name);
    ImGui::SameLine(58 * s);
    char text[24];
    std::snprintf(text, sizeof text, format, value);
    ImGui::SetNextItemWidth(-52 * s);
    float shown = static_cast<float>(value);
    const bool moved =
        ImGui::SliderFloat(id, &shown, static_cast<float>(low), static_cast<float>(high), "");
    if (ImGui::IsItemClicked(1)) {
        value = 0.5 * (low + high);
        return true;
    }
    ImGui::SameLine(ImGui::GetWindowContentRegionMax().x - ImGui::CalcTextSize(text).x);
    ImGui::TextUnformatted(text);
    if (moved) value = shown;
    return moved;
}

void sensor_row(const char* tool, const SensorReading* reading, SensorVerdict verdict) {
    unsigned packed = colour::kGood;
    const char* word = "ok";
    switch (verdict) {
        case SensorVerdict::fine:
            break;
        case SensorVerdict::absent:
            packed = colour::kFaint, word = "none";
            break;
        case SensorVerdict::lost:
            packed = colour::kBad, word = "out of range";
            break;
        case SensorVerdict::stale:
            packed = colour::kBad, word = "silent";
            break;
        case SensorVerdict::frozen:
            packed = colour::kBad, word = "frozen";
            break;
        case SensorVerdict::jumped:
            packed = colour::kWarn, word = "jumped";
            break;
        case SensorVerdict::poor:
            packed = colour::kWarn, word = "distorted";
            break;
    }
    row(tool, word, packed);
    if (reading && verdict != SensorVerdict::absent) {
        const Vector3 t = reading->world_from_sensor.translation;
        ImGui::PushFont(fonts().small);
        ImGui::TextDisabled("  %.1f  %.1f  %.1f mm", t.x, t.y, t.z);
        if (reading->quality >= 0) {
            ImGui::SameLine(ImGui::GetWindowWidth() - 74 * ImGui::GetFontSize() / 12);
            ImGui::ProgressBar(reading->quality,
                               {60 * ImGui::GetFontSize() / 12, ImGui::GetTextLineHeight()}, "");
        }
        ImGui::PopFont();
    }
    const char* sentence = verdict_sentence(verdict);
    if (*sentence) coloured(packed, sentence);
}

void calibration_row(const char* tool,
                     const std::optional<Calibration>& calibration,
                     const char* without) {
    if (!calibration) {
        row(tool, without, colour::kFaint);
        return;
    }
    // 1.5 and 3 mm: what a needle of 18 gauge and a target of 5 mm forgive.
    const double rms = calibration->rms_mm;
    const unsigned packed = rms < 0      ? colour::kText
                            : rms <= 1.5 ? colour::kGood
                            : rms <= 3   ? colour::kWarn
                                         : colour::kBad;
    if (rms < 0) {
        row(tool, "not measured", packed);
    } else {
        row(tool, "rms %.2f mm", rms, packed);
    }
    for (const std::string& warning : calibration->warnings) coloured(colour::kWarn, warning);
}

// Where a recording or script is, and how fast it runs.
void draw_pace(PacedTracker& paced) {
    char text[48];
    const double at = paced.at_s(), whole = paced.duration_s();
    std::snprintf(text, sizeof text,
                  paced.speed() == 0 ? "%.1f of %.1f s, still" : "%.1f of %.1f s", at, whole);
    float place = static_cast<float>(at);
    ImGui::SetNextItemWidth(-1);
    if (ImGui::SliderFloat("##place", &place, 0, static_cast<float>(whole), text)) {
        paced.jump(place - at);
    }
    float speed = static_cast<float>(paced.speed());
    ImGui::SetNextItemWidth(-1);
    if (ImGui::SliderFloat("##speed", &speed, 0, 8, "%.2f times as fast",
                           ImGuiSliderFlags_Logarithmic)) {
        paced.set_speed(speed);
    }
    if (ImGui::IsItemClicked(1)) paced.set_speed(1);
}

void draw_attempt(const AttemptView& view) {
    ImGui::Separator();
    char clock[32];
    std::snprintf(clock, sizeof clock, "%d:%04.1f", static_cast<int>(view.seconds) / 60,
                  std::fmod(view.seconds, 60.0));
    row("Recording", clock, colour::kBad);
    row("Insertions", "%.0f", static_cast<double>(view.insertions));
    if (view.depth_mm > 0) {
        row("Tip", view.tip_in_view ? "in the picture" : "out of the plane",
            view.tip_in_view ? colour::kGood : colour::kWarn);
    }
    if (view.in_no_go) coloured(colour::kBad, "The needle is in a structure to be spared.");
    ImGui::PushFont(fonts().small);
    for (const std::string& news : view.news) ImGui::TextDisabled("%s", news.c_str());
    ImGui::PopFont();
    if (!view.problem.empty()) coloured(colour::kBad, view.problem);
}

}  // namespace

void draw_exercise_panel(App& app) {
    const Exercise& exercise = app.current();
    heading(exercise.title.empty() ? exercise.name.c_str() : exercise.title.c_str());
    char stars[32];
    std::snprintf(stars, sizeof stars, "%s, difficulty %d of 5", exercise.kind.c_str(),
                  exercise.difficulty);
    ImGui::PushFont(fonts().small);
    ImGui::TextDisabled("%s", stars);
    ImGui::PopFont();
    if (!exercise.description.empty()) ImGui::TextWrapped("%s", exercise.description.c_str());
    const float wide = ImGui::GetContentRegionAvail().x;
    ImGui::PushStyleColor(ImGuiCol_Button,
                          app.attempt ? colour::rgba(150, 58, 54) : colour::rgba(32, 112, 92));
    if (ImGui::Button(app.attempt ? "Finish (B)" : "Start attempt (B)", {wide, 0})) {
        if (app.attempt) {
            finish_attempt(app);
        } else {
            start_attempt(app, "");
        }
    }
    ImGui::PopStyleColor();
    const FrameRecord& record = app.frame().record;
    const Point3 tip = record.needle.mannequin_from_drawn * Point3{0, 0, 0};
    for (std::size_t i = 0; i < exercise.targets.size(); ++i) {
        const Target& target = exercise.targets[i];
        const std::string name =
            target.name.empty() ? "Target " + std::to_string(i + 1) : target.name;
        const double to_target_mm = distance(tip, target_now(app, i));
        if (record.tools.has_needle && i < app.hits.size() &&
            to_target_mm <= target.hit_radius_mm) {
            app.hits[i] = true;
        }
        const bool hit = i < app.hits.size() && app.hits[i];
        if (record.tools.has_needle) {
            row_distance((name + (hit ? ", reached" : ", tip at")).c_str(), to_target_mm,
                         target.hit_radius_mm);
        } else {
            row(name.c_str(), hit ? "reached" : "to reach", hit ? colour::kGood : colour::kDim);
        }
    }
    if (record.tools.has_needle) row("Needle depth", "%.0f mm", record.needle.depth_mm);
    if (app.attempt) {
        draw_attempt(app.attempt->view());
    } else if (app.score) {
        ImGui::Separator();
        if (!app.score->pass_marks.empty()) {
            coloured(app.score->passed ? colour::kGood : colour::kWarn,
                     app.score->passed ? "The last attempt passed."
                                       : "The last attempt did not pass yet.");
        }
        if (ImGui::Button("Show scores", {wide, 0})) app.show_score = true;
    }
    if (app.mouse) {
        ImGui::Separator();
        if (ImGui::Button(app.mouse->has_needle() ? "Withdraw needle (N)" : "Take needle (N)",
                          {-1, 0})) {
            toggle_needle(app, true);
        }
    }
}

void draw_tracker_panel(App& app) {
    heading("Tracker");
    static const struct {
        const char* spec;
        const char* name;
    } kTrackers[] = {{"mouse", "Mouse and keyboard"},
                     {"viper", "Polhemus Viper"},
                     {"3dg", "NDI 3D Guidance"},
                     {"liberty", "Polhemus Liberty / Patriot"},
                     {"igtl:127.0.0.1:18944", "OpenIGTLink, this machine"},
                     {"null", "None"}};
    std::string shown = app.tracker_spec;
    for (const auto& t : kTrackers) {
        if (app.tracker_spec == t.spec) shown = t.name;
    }
    ImGui::SetNextItemWidth(-1);
    if (ImGui::BeginCombo("##tracker", shown.c_str())) {
        for (const auto& t : kTrackers) {
            if (ImGui::Selectable(t.name, app.tracker_spec == t.spec)) choose_tracker(app, t.spec);
        }
        for (const Sweep& sweep : app.current().sweeps) {
            const std::string spec = "sweep:" + sweep.name;
            if (ImGui::Selectable(("Script: " + sweep.name).c_str(), app.tracker_spec == spec)) {
                choose_tracker(app, spec);
            }
        }
        ImGui::EndCombo();
    }
    if (app.paced) draw_pace(*app.paced);
    const TrackerHealth health = app.scan->tracker_health();
    if (health.phase == TrackerPhase::streaming) {
        if (health.rate_hz > 0) row("Rate", "%.0f Hz", health.rate_hz);
    } else {
        row("State", phase_name(health.phase),
            health.phase == TrackerPhase::failed ? colour::kBad : colour::kWarn);
    }
    if (!health.message.empty()) {
        coloured(health.phase == TrackerPhase::failed ? colour::kBad : colour::kDim,
                 health.message);
    }
    if (health.bad_frames > 0) {
        row("Discarded", "%.0f", static_cast<double>(health.bad_frames), colour::kWarn);
    }
    const ScanFrame& frame = app.frame();
    const SensorAssignment places =
        frame.reading.in_mannequin ? SensorAssignment{} : app.controls.assignment;
    const auto sensor = [&](int index) -> const SensorReading* {
        if (index < 0 || index >= frame.reading.sensor_count) return nullptr;
        return &frame.reading.sensors[static_cast<std::size_t>(index)];
    };
    sensor_row("Probe", sensor(places.probe), frame.probe_verdict);
    sensor_row("Needle", sensor(places.needle), frame.needle_verdict);
    ImGui::Separator();
    heading("Calibration");
    if (frame.reading.in_mannequin) {
        row("Probe, needle, mannequin", "exact", colour::kGood);
    } else {
        calibration_row("Probe", app.calibrations.probe, "none");
        calibration_row("Needle", app.calibrations.needle, "none");
        calibration_row("Mannequin", app.calibrations.mannequin, "none");
        if (!app.calibrations.mannequin || !app.calibrations.probe) {
            coloured(colour::kDim, "Press F3 to set up.");
        }
    }
}

void draw_console_panel(App& app) {
    const float s = app.window->scale();
    ImageSettings& image = app.controls.settings;
    const float half = 0.5f * (ImGui::GetContentRegionAvail().x - 7 * s);
    ImGui::PushStyleColor(ImGuiCol_Button, app.controls.frozen ? colour::rgba(38, 104, 124)
                                                               : colour::rgba(40, 49, 60));
    if (ImGui::Button(app.controls.frozen ? "Live" : "Freeze", {half, 0})) {
        set_frozen(app, !app.controls.frozen);
    }
    ImGui::PopStyleColor();
    ImGui::SameLine();
    ImGui::PushStyleColor(ImGuiCol_Button,
                          app.measuring ? colour::rgba(38, 104, 124) : colour::rgba(40, 49, 60));
    if (ImGui::Button("Measure", {half, 0})) app.measuring = !app.measuring;
    ImGui::PopStyleColor();
    slider("Gain", "##gain", image.gain_db, -30, 30, "%+.0f dB");
    slider("Range", "##range", image.dynamic_range_db, 40, 90, "%.0f dB");
    ImGui::AlignTextToFramePadding();
    ImGui::TextDisabled("Depth");
    ImGui::SameLine(58 * s);
    const float step = ImGui::GetFrameHeight();
    if (ImGui::Button("-##depth", {step, 0})) change_depth(app, -10);
    ImGui::SameLine(0, 4 * s);
    if (ImGui::Button("+##depth", {step, 0})) change_depth(app, 10);
    ImGui::SameLine();
    ImGui::Text("%.0f cm", app.depth_mm / 10);
    ImGui::AlignTextToFramePadding();
    ImGui::TextDisabled("Focus");
    ImGui::SameLine(58 * s);
    if (ImGui::Button("-##focus", {step, 0})) change_focus(app, -5);
    ImGui::SameLine(0, 4 * s);
    if (ImGui::Button("+##focus", {step, 0})) change_focus(app, 5);
    ImGui::SameLine();
    ImGui::Text("%.1f cm", app.focus_mm / 10);
    ImGui::SameLine(ImGui::GetWindowContentRegionMax().x - 52 * s);
    if (ImGui::Button("Flip", {52 * s, 0})) image.flip_left_right = !image.flip_left_right;
    ImGui::TextDisabled("TGC");
    ImGui::SameLine(ImGui::GetWindowContentRegionMax().x - 52 * s);
    if (ImGui::SmallButton("Level")) image.tgc_db = {};
    ImGui::PushStyleVar(ImGuiStyleVar_ItemSpacing, {7 * s, 2 * s});
    ImGui::PushStyleVar(ImGuiStyleVar_FramePadding, {7 * s, 0});
    ImGui::PushFont(fonts().small);
    for (int i = 0; i < 8; ++i) {
        ImGui::PushID(i);
        float value = static_cast<float>(image.tgc_db[static_cast<std::size_t>(i)]);
        ImGui::AlignTextToFramePadding();
        ImGui::TextDisabled("%.0f cm", app.depth_mm / 80 * (i + 0.5));
        ImGui::SameLine(58 * s);
        ImGui::SetNextItemWidth(-30 * s);
        if (ImGui::SliderFloat("##tgc", &value, -20, 20, "")) {
            image.tgc_db[static_cast<std::size_t>(i)] = value;
        }
        if (ImGui::IsItemClicked(1)) image.tgc_db[static_cast<std::size_t>(i)] = 0;
        char text[16];
        std::snprintf(text, sizeof text, "%+.0f", value);
        ImGui::SameLine(ImGui::GetWindowContentRegionMax().x - ImGui::CalcTextSize(text).x);
        ImGui::TextDisabled("%s", value == 0 ? "0" : text);
        ImGui::PopID();
    }
    ImGui::PopFont();
    ImGui::PopStyleVar(2);
}

void draw_effects_panel(App& app) {
    const ScanFrame& frame = app.frame();
    heading("Effects");
    char total[48];
    std::snprintf(total, sizeof total, "%.2f ms a frame", frame.frame_ms);
    ImGui::SameLine(ImGui::GetWindowContentRegionMax().x - ImGui::CalcTextSize(total).x);
    ImGui::TextDisabled("%s", total);
    ImGui::PushFont(fonts().small);
    const Renderer::Accuracy& accuracy = frame.accuracy;
    char lines[48];
    std::snprintf(lines, sizeof lines, "%s, %d x %d", accuracy.level == 0 ? "full" : "reduced",
                  accuracy.scanlines, accuracy.samples);
    row("Accuracy", lines, accuracy.level == 0 ? colour::kText : colour::kWarn);
    const float right = ImGui::GetWindowContentRegionMax().x;
    for (int i = 0; i < frame.cost_count; ++i) {
        const EffectCost& cost = frame.costs[static_cast<std::size_t>(i)];
        const ImVec2 at = ImGui::GetCursorScreenPos();
        const float line = ImGui::GetTextLineHeight();
        if (cost.ran && frame.frame_ms > 0) {
            const float part = static_cast<float>(std::min(cost.ms / frame.frame_ms, 1.0));
            ImGui::GetWindowDrawList()->AddRectFilled(
                at, {at.x + part * ImGui::GetContentRegionAvail().x, at.y + line},
                colour::rgba(72, 186, 214, 46), 2);
        }
        ImGui::PushStyleColor(ImGuiCol_Text, cost.ran ? colour::kText : colour::kFaint);
        ImGui::TextUnformatted(cost.name);
        char value[64];
        if (cost.ran) {
            std::snprintf(value, sizeof value, "%.2f", cost.ms);
        } else {
            std::snprintf(value, sizeof value, "%s", cost.skipped_because);
        }
        ImGui::SameLine(std::max(right - ImGui::CalcTextSize(value).x, 90.0f));
        ImGui::TextUnformatted(value);
        ImGui::PopStyleColor();
    }
    ImGui::PopFont();
}

void draw_view3d_panel(App& app, float height) {
    const ScanFrame& frame = app.frame();
    ImGui::BeginChild("view3d", {0, height}, false, ImGuiWindowFlags_NoScrollbar);
    const ImVec2 size = ImGui::GetContentRegionAvail();
    const ImVec2 corner = ImGui::GetCursorScreenPos();
    View3dInput input;
    const ToolPoses& tools = frame.record.tools;
    input.has_probe = tools.has_probe;
    input.has_needle = tools.has_needle;
    input.in_contact = frame.status == FrameStatus::rendered;
    input.mannequin_from_probe = tools.mannequin_from_probe;
    input.mannequin_from_needle = frame.record.needle.mannequin_from_drawn;
    input.layout = frame.layout;
    input.depth_mm = frame.depth_mm;
    input.image_width_px = frame.width_px;
    input.image_height_px = frame.height_px;
    input.flipped = app.controls.settings.flip_left_right;
    input.image_texture = app.texture->name();
    input.hit = app.hits;
    for (std::size_t i = 0; i < app.current().targets.size() && i < 64; ++i)
        input.target_centres.push_back(target_now(app, i));
    if (app.view_pace.due(app.now_s) || !app.view_texture)
        app.view_texture =
            app.view3d->draw(static_cast<int>(size.x), static_cast<int>(size.y), input);
    ImGui::GetWindowDrawList()->AddImageRounded(app.view_texture, corner,
                                                {corner.x + size.x, corner.y + size.y}, {0, 1},
                                                {1, 0}, 0xFFFFFFFF, 5 * app.window->scale());
    ImGui::InvisibleButton("orbit", size,
                           ImGuiButtonFlags_MouseButtonLeft | ImGuiButtonFlags_MouseButtonRight);
    const ImGuiIO& io = ImGui::GetIO();
    if (ImGui::IsItemActive() && ImGui::IsMouseDown(0)) {
        app.view3d->orbit().yaw_rad -= 0.008 * io.MouseDelta.x;
        app.view3d->orbit().pitch_rad =
            std::clamp(app.view3d->orbit().pitch_rad + 0.008 * io.MouseDelta.y, -1.5, 1.5);
    }
    if (ImGui::IsItemHovered() && io.MouseWheel != 0) {
        double& d = app.view3d->orbit().distance_mm;
        d = std::clamp(d * std::pow(0.9, io.MouseWheel), 150.0, 3000.0);
    }
    if (ImGui::IsItemHovered() && ImGui::IsMouseDoubleClicked(0)) {
        app.view3d->home();
        app.view3d->from() = ViewFrom::outside;
    }
    if (app.view3d->from() != ViewFrom::outside) {
        ImGui::SetCursorPos({6 * app.window->scale(), 4 * app.window->scale()});
        ImGui::PushFont(fonts().small);
        ImGui::TextDisabled(app.view3d->from() == ViewFrom::probe ? "from the probe (O)"
                                                                  : "from the needle (O)");
        ImGui::PopFont();
    }
    if (ImGui::IsItemActive() && ImGui::IsMouseDown(1) && app.mouse) {
        // The right button puts the probe, or with Shift the needle, where it points.
        const ViewRay ray = app.view3d->ray(io.MousePos.x - corner.x, io.MousePos.y - corner.y);
        if (const auto touch = app.skin->enter(ray.start, ray.direction, 4000)) {
            const Vector3 inward = -1 * app.skin->normal(*touch);
            if (io.KeyShift) {
                app.mouse->place_needle(*touch, inward);
            } else {
                app.mouse->put_probe(*touch, inward);
            }
        }
    }
    ImGui::EndChild();
}

}  // namespace sonocase::runtime
