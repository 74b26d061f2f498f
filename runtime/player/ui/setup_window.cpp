// SPDX-License-Identifier: Apache-2.0

// The guided set-up (runtime/player/app/setup_guide.h) as a page: its steps, what is held where and
// how it moves as a drawing, and how good the readings are so far.

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <numbers>

#include <imgui.h>

#include "runtime/display/theme.h"
#include "runtime/player/ui/pages.h"
#include "runtime/player/ui/panels.h"
#include "runtime/player/ui/parts/icons.h"
#include "runtime/player/ui/parts/layout.h"
#include "runtime/player/ui/parts/panel_parts.h"
#include "runtime/player/words/words.h"

namespace sonocase::runtime::inline player_ui {

namespace {

constexpr float kWide = 300, kHigh = 110;  // of a drawing, in its own units

struct Pen {
    ImDrawList* draw;
    ImVec2 at;
    float s;  // pixels of a unit

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

void draw_setup_drawing(Ui& ui, const Box& box, SetupStep step) {
    ui.fill(box, colour::kRaised, 8);
    const float fit = std::min(box.w / kWide, box.h / kHigh), s = fit * ui.scale();
    const Pen pen{ImGui::GetWindowDrawList(),
                  {(box.x + 0.5f * (box.w - fit * kWide)) * ui.scale(),
                   (box.y + 0.5f * (box.h - fit * kHigh)) * ui.scale()},
                  s};
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
}

namespace {

// What a step's list entry says below its title.
std::string step_words(const SetupGuide& guide, SetupStep step) {
    if (guide.found(step)) return tr("found");
    const bool now = step == guide.step();
    const double left = setup_seconds(step) - (now ? guide.view().seconds : 0);
    return now && guide.recording() ? filled(tr("%.0f s to go"), std::max(left, 0.0))
                                    : filled(tr("about %.0f s"), setup_seconds(step));
}

void draw_step_list(Ui& ui, const Box& card, SetupGuide& guide) {
    ui.card(card, "steps");
    Box room = card.inset(12);
    const float high = std::min(56.0f, room.h / kSetupSteps);
    for (int i = 0; i < kSetupSteps; ++i) {
        const auto step = static_cast<SetupStep>(i);
        const bool now = step == guide.step(), found = guide.found(step);
        Box row = room.take_top(high);
        ui.begin_in_control();
        if (now) ui.fill(row.inset(0, 2), colour::kChosen, 6);
        if (now) ui.fill({row.x, row.y + 8, 3, row.h - 16}, colour::kAccent, 1.5f);
        const float x = row.x + 22, y = row.y + 0.5f * row.h;
        if (found) {
            ui.icon(Icon::pass, x - 12, y - 12, 24, colour::kGood);
        } else {
            ui.text({x - 12, y - 12, 24, 24}, std::to_string(i + 1), Type::bold,
                    now ? colour::kAccent : colour::kDim, Align::centre);
        }
        const Box words{row.x + 42, row.y, row.w - 46, row.h};
        const std::string title = tr(setup_title(step));
        Type type = now ? Type::bold : Type::body;
        if (ui.width(title, type) > words.w) type = Type::small;
        ui.text({words.x, y - 20, words.w, 20}, title, type, now ? colour::kText : colour::kDim,
                Align::left, true);
        ui.text({words.x, y, words.w, 18}, step_words(guide, step), Type::small, colour::kDim,
                Align::left, true);
        ui.end_in_control();
        if (ui.area(setup_title(step), row).clicked) guide.go_to(step);
    }
}

// The steps where there is no room for their names.
void draw_step_tabs(Ui& ui, const Box& row, SetupGuide& guide) {
    for (int i = 0; i < kSetupSteps; ++i) {
        const auto step = static_cast<SetupStep>(i);
        ButtonStyle style;
        style.chosen = step == guide.step();
        style.tip = setup_title(step);
        if (guide.found(step)) style.icon = Icon::check;
        if (ui.button(setup_title(step), row.column(i, kSetupSteps, 4),
                      guide.found(step) ? "" : std::to_string(i + 1), style))
            guide.go_to(step);
    }
}

// The sensors that were heard, by their names or numbers, and which tool each is on: one row and
// three buttons per sensor.
std::optional<std::pair<int, ToolOf>> draw_roles(Ui& ui, Box& room, const SetupPageInput& input) {
    struct Column {
        ToolOf role;
        const char* words;
        int sensor;
    };
    const SensorAssignment places = places_of(input.reading, input.assignment);
    const Column columns[] = {{ToolOf::probe, "Probe", places.probe},
                              {ToolOf::needle, "Needle", places.needle},
                              {ToolOf::reference, "Reference", places.reference}};
    std::optional<std::pair<int, ToolOf>> given;
    const TrackerHealth& tracker = input.tracker;
    constexpr float kRow = 62;
    const int count = std::clamp(input.reading.sensor_count, 2, kMaxSensors);
    int left_out = 0;
    for (int i = 0; i < count; ++i) {
        const auto at = static_cast<std::size_t>(i);
        const bool named = at < tracker.sensors.size() && !tracker.sensors[at].empty();
        // A place that a tracker with names keeps free.
        if (!tracker.sensors.empty() && !named) continue;
        if (room.h < kRow) {
            ++left_out;
            continue;
        }
        const SensorReading& sensor = input.reading.sensors[at];
        const bool there = input.live && i < input.reading.sensor_count &&
                           sensor.state != SensorState::absent && sensor.state != SensorState::lost;
        Box line = room.take_top(24);
        const Vector3 t = sensor.world_from_sensor.translation;
        const std::string where =
            there ? filled("%.0f  %.0f  %.0f mm", t.x, t.y, t.z) : std::string(tr("no readings"));
        ui.text(line.take_right(ui.width(where, Type::small) + 4, 6), where, Type::small,
                there ? colour::kDim : colour::kFaint, Align::right, true);
        ui.text(line, named ? tracker.sensors[at] : filled(tr("Sensor %d"), i + 1), Type::small,
                there ? colour::kText : colour::kDim, Align::left, true);
        const Box row = room.take_top(30, 8);
        for (int c = 0; c < 3; ++c) {
            ButtonStyle style;
            style.chosen = columns[c].sensor == i;
            style.may_cut = true;
            style.tip = "Which tool this sensor is on; the reference is fixed to the mannequin";
            const std::string id =
                std::string(role_name(columns[c].role)) + "-" + std::to_string(i + 1);
            if (ui.button(id.c_str(), row.column(c, 3, 4), tr(columns[c].words), style))
                given = {i, columns[c].role};
        }
    }
    if (left_out > 0 && room.h > 20)
        ui.text(room.take_top(20), filled(tr("%d more: make the window taller"), left_out),
                Type::small, colour::kDim, Align::left, true);
    return given;
}

void draw_tracker_words(Ui& ui, Box& room, const SetupPageInput& input) {
    const TrackerHealth& tracker = input.tracker;
    ui.text(room.take_top(22),
            tracker.device.empty() ? tr("No tracker") : tr_message(tracker.device), Type::bold,
            colour::kText, Align::left, true);
    const std::string state =
        input.live && tracker.phase == TrackerPhase::streaming
            ? filled(tr("%.0f readings per second"), tracker.rate_hz)
            : std::string(tr(phase_name(tracker.phase))) + " · " + tr("no readings");
    ui.text(room.take_top(22, 8), state, Type::small, input.live ? colour::kDim : colour::kWarn,
            Align::left, true);
    if (!tracker.message.empty())
        room.take_top(
            ui.paragraph(room, tr_message(tracker.message), Type::small, colour::kWarn, true), 8);
}

// What each tool's calibration is worth, before it is saved.
void draw_summary(Ui& ui, Box& room, const Calibrations& calibrations) {
    const std::pair<const char*, const std::optional<Calibration>*> tools[] = {
        {"Probe", &calibrations.probe},
        {"Needle", &calibrations.needle},
        {"Mannequin", &calibrations.mannequin}};
    for (const auto& [name, calibration] : tools) {
        const std::string words = !*calibration ? tr("not calibrated")
                                  : (*calibration)->rms_mm < 0
                                      ? tr("not measured")
                                      : filled(tr("rms %.2f mm"), (*calibration)->rms_mm);
        ui.row(room.take_top(28), tr(name), words, *calibration ? colour::kText : colour::kDim);
    }
}

// The residuals of the newest readings as a curve, up to 5 mm.
void draw_course(Ui& ui, const Box& box, const std::vector<float>& residuals_mm) {
    constexpr float kTopMm = 5;
    ui.fill(box, colour::kRaised, 4);
    if (residuals_mm.size() < 2) return;
    std::vector<float> xy;
    for (std::size_t i = 0; i < residuals_mm.size(); ++i) {
        xy.push_back(box.x +
                     box.w * static_cast<float>(i) / static_cast<float>(residuals_mm.size() - 1));
        xy.push_back(box.y + box.h * (1 - std::clamp(residuals_mm[i] / kTopMm, 0.0f, 1.0f)));
    }
    ui.curve(xy, colour::kAccent, 2);
}

// Fields of the directions that the tool has leaned in; the disc is where it leans now.
void draw_tilts(Ui& ui, const Box& box, const TiltFields& tilts) {
    constexpr double kPi = std::numbers::pi;
    const float x = box.x + 0.5f * box.w, y = box.y + 0.5f * box.h;
    const float radius = 0.5f * std::min(box.w, box.h);
    const auto at = [&](double lean_rad) {
        return radius * static_cast<float>(std::min(lean_rad / TiltFields::kEdgeRad, 1.0));
    };
    ImDrawList* draw = ImGui::GetWindowDrawList();
    const float s = ui.scale();
    const auto field = [&](float inner, float outer, double from, double to, bool leaned) {
        const auto a0 = static_cast<float>(from + 0.03), a1 = static_cast<float>(to - 0.03);
        draw->PathArcTo({x * s, y * s}, outer * s, a0, a1, 16);
        if (inner > 0) draw->PathArcTo({x * s, y * s}, inner * s, a1, a0, 16);
        if (leaned) {
            // Rings are not convex: filled as their four corners and the arcs between, in slices.
            draw->PathClear();
            constexpr int kSlices = 8;
            for (int i = 0; i < kSlices; ++i) {
                const float b0 = a0 + (a1 - a0) * static_cast<float>(i) / kSlices;
                const float b1 = a0 + (a1 - a0) * static_cast<float>(i + 1) / kSlices;
                const auto p = [&](float r, float a) {
                    return ImVec2{(x + r * std::cos(a)) * s, (y + r * std::sin(a)) * s};
                };
                draw->AddQuadFilled(p(inner, b0), p(outer, b0), p(outer, b1), p(inner, b1),
                                    colour::kAccent);
            }
        } else {
            draw->PathStroke(colour::kEdge, ImDrawFlags_Closed, std::max(s, 1.0f));
        }
    };
    const float first = at(TiltFields::kInnerRad), second = at(TiltFields::kOuterRad);
    field(0, first - 2, -kPi, kPi, tilts.leaned[0]);
    const auto ring = [&](int count, int from, float inner, float outer) {
        for (int i = 0; i < count; ++i) {
            const double a = -kPi + 2 * kPi * i / count;
            field(inner, outer, a, a + 2 * kPi / count,
                  tilts.leaned[static_cast<std::size_t>(from + i)]);
        }
    };
    ring(TiltFields::kInner, 1, first, second - 2);
    ring(TiltFields::kOuter, 1 + TiltFields::kInner, second, radius);
    const double lean = std::hypot(tilts.x_rad, tilts.y_rad);
    const auto shown = static_cast<float>(lean > 0 ? at(lean) / lean : 0);
    ui.disc(x + shown * static_cast<float>(tilts.x_rad),
            y + shown * static_cast<float>(tilts.y_rad), 5, colour::kText);
}

// The figure that decides in large type, with what it has to reach.
void draw_figure(Ui& ui, Box& room, SetupStep step, const SetupView& view) {
    const double needed = setup_needed_mm(step);
    const bool large = room.h > 200;
    if (large)
        ui.text(room.take_top(22),
                tr(step == SetupStep::mannequin ? "Distance from the skin" : "Uncertainty"),
                Type::body, colour::kDim, Align::left, true);
    Box row = room.take_top(large ? 44 : 30, 4);
    const bool known = view.figure_mm >= 0, reached = known && view.figure_mm < needed;
    const std::string number = known ? text("%.2f", view.figure_mm) : "–";
    const Type type = large ? Type::title : Type::heading;
    const float wide = ui.width(number, type) + 2;
    ui.text(row.take_left(wide, 6), number, type, known ? colour::kText : colour::kDim);
    ui.text(row.take_left(ui.width("mm", Type::body) + 2, 12), "mm", Type::body, colour::kDim);
    if (reached) ui.icon(Icon::pass, row.x, row.y + 0.5f * row.h - 9, 18, colour::kGood);
    if (reached) row.take_left(24);
    ui.text(row, filled(tr("needed %.1f mm"), needed), Type::small,
            reached ? colour::kGood : colour::kDim, Align::left, true);
}

// How good the readings are so far.
void draw_measure(Ui& ui, Box room, const SetupGuide& guide) {
    const SetupView& view = guide.view();
    const SetupStep step = guide.step();
    const double expected = setup_seconds(step);
    if (room.h > 130) {
        Box time = room.take_bottom(24, 8);
        const std::string left = filled(tr("%.0f s"), std::max(expected - view.seconds, 0.0));
        ui.text(time.take_right(ui.width("00 s", Type::bold) + 4, 8), left, Type::bold,
                colour::kText, Align::right);
        const Box groove{time.x, time.y + 9, time.w, 6};
        ui.fill(groove, colour::kControlPressed, 3);
        const auto share = static_cast<float>(std::clamp(view.seconds / expected, 0.0, 1.0));
        ui.fill({groove.x, groove.y, share * groove.w, groove.h}, colour::kAccent, 3);
    }
    draw_figure(ui, room, step, view);
    if (!view.sentence.empty() && room.h > 20)
        room.take_top(
            ui.paragraph({room.x, room.y, room.w, std::min(room.h, 60.0f)}, view.sentence,
                         Type::small, view.good_enough ? colour::kGood : colour::kText, true),
            8);
    if (!view.residuals_mm.empty() && room.h > 90) {
        if (room.h > 130)
            ui.text(room.take_top(20), filled(tr("Readings disagree by %.2f mm"), view.rms_mm),
                    Type::small, colour::kDim, Align::left, true);
        draw_course(ui, room.take_top(56, 12), view.residuals_mm);
    }
    if (view.tilts && room.h > 110) {
        Box row = room.take_top(std::min(room.h, 180.0f));
        draw_tilts(ui, row.take_left(std::min(row.h, 0.6f * row.w), 16), *view.tilts);
        ui.text(row.take_top(22), tr("Tilts"), Type::bold, colour::kText, Align::left, true);
        ui.text(row.take_top(26, 4),
                filled(tr("%d of %d"), view.tilts->count(), TiltFields::kCount), Type::bold,
                colour::kText, Align::left, true);
        ui.paragraph(row, tr("The dot is the tool: lean it into the empty fields."), Type::small,
                     colour::kDim, true);
    } else if (room.h > 30) {
        ui.row(room.take_top(26),
               tr(step == SetupStep::needle ? "Depths recorded" : "Movement covered"),
               step == SetupStep::needle ? filled(tr("%d of %d"), view.recordings, 3)
                                         : filled(tr("%.0f %%"), 100 * view.coverage));
    }
}

// Starts and ends a recording; at least 44 u high.
void draw_record(Ui& ui, const Box& box, SetupGuide& guide, bool live) {
    const bool on = guide.recording();
    ButtonStyle style;
    style.icon = on ? Icon::pause : Icon::rec;
    style.primary = !guide.view().good_enough || on;
    style.chosen = false;
    style.enabled = live || on;
    style.tip = live ? "Takes readings while you move the tool" : "No readings arrive";
    if (ui.button("record", box, tr(on ? "Stop" : "Record"), style)) guide.record(!on);
}

void draw_step(Ui& ui, Box room, SetupGuide& guide, const SetupPageInput& input) {
    const SetupStep step = guide.step();
    const bool roomy = room.h > 260;
    if (roomy)
        ui.text(room.take_top(22),
                filled(tr("Step %d of %d"), static_cast<int>(step) + 1, kSetupSteps), Type::small,
                colour::kDim);
    if (roomy)
        ui.text(room.take_top(38, 4), tr(setup_title(step)),
                ui.width(tr(setup_title(step)), Type::title) < room.w ? Type::title : Type::heading,
                colour::kText, Align::left, true);
    const bool measured = step != SetupStep::trackers && step != SetupStep::done;
    if (measured && !input.reading.in_mannequin)
        draw_record(ui, room.take_bottom(48, 8), guide, input.live);
    const Type type = roomy && room.w > 420 ? Type::heading : Type::small;
    const char* words = tr(setup_instruction(step));
    const float high = std::min(ui.paragraph_height(room.w, words, type), room.h);
    ui.paragraph(room.take_top(high, 12), words, type, colour::kText, true);
    if (input.reading.in_mannequin) {
        const Box line = room.take_top(60, 8);
        ui.icon(Icon::warn, line.x, line.y + 2, 18, colour::kWarn);
        ui.paragraph({line.x + 26, line.y, line.w - 26, line.h},
                     tr("The mouse and scripts need no set-up. Choose a tracker that measures "
                        "first."),
                     Type::small, colour::kWarn, true);
    }
    if (room.h <= 90) return;
    if (step == SetupStep::done && input.width_px > 0 && !input.picture.empty()) {
        ui.fill(room, colour::kPicture, 8);
        const auto wide = static_cast<float>(input.width_px),
                   high_px = static_cast<float>(input.height_px);
        const float fit = std::min(room.w / wide, room.h / high_px);
        const float w = fit * wide, h = fit * high_px;
        ui.image(input.picture.id(),
                 {room.x + 0.5f * (room.w - w), room.y + 0.5f * (room.h - h), w, h});
        return;
    }
    draw_setup_drawing(ui, room, step);
}

// The right column: sensors, what was found, or how good the readings are.
void draw_side(
    Ui& ui, Box room, SetupGuide& guide, const SetupPageInput& input, SetupRequest& request) {
    if (input.reading.in_mannequin) return;
    switch (guide.step()) {
        case SetupStep::trackers:
            draw_tracker_words(ui, room, input);
            request.role = draw_roles(ui, room, input);
            break;
        case SetupStep::done: draw_summary(ui, room, input.calibrations); break;
        default: draw_measure(ui, room, guide);
    }
}

// Whether the step's aim is reached, and if not what is missing.
bool may_go_on(const SetupGuide& guide, const SetupPageInput& input, std::string& why) {
    const SetupStep step = guide.step();
    if (input.reading.in_mannequin) {
        why = "";
        return false;
    }
    if (step == SetupStep::trackers) {
        if (!input.live) why = tr("Next opens when readings arrive.");
        return input.live;
    }
    if (guide.recording()) why = tr("Stop the recording first.");
    if (guide.recording()) return false;
    if (!guide.view().good_enough)
        why = filled(tr("Next opens when it is known to %.1f mm and has moved enough."),
                     setup_needed_mm(step));
    return guide.view().good_enough;
}

// Back, over again, and on. True: save.
bool draw_foot(Ui& ui, Box foot, SetupGuide& guide, const SetupPageInput& input) {
    const SetupStep step = guide.step();
    const int number = static_cast<int>(step);
    const bool narrow = foot.w < 720;
    ButtonStyle style;
    style.icon = Icon::back;
    style.enabled = number > 0;
    style.tip = "The step before";
    const auto width = [&](const char* words) {
        return narrow ? 52.0f : 56 + ui.width(words, Type::body);
    };
    if (ui.button("before", foot.take_left(width(tr("Back")), 8), narrow ? "" : tr("Back"), style))
        guide.go_to(static_cast<SetupStep>(number - 1));
    const bool measured = step != SetupStep::trackers && step != SetupStep::done;
    style.icon = Icon::again;
    style.enabled = measured && (guide.view().readings > 0 || guide.view().recordings > 0);
    style.tip = "Forgets the readings of this step";
    const char* over = tr("Start this step over");
    if (ui.button("over", foot.take_left(width(over), 8), narrow ? "" : over, style))
        guide.clear_step();
    ButtonStyle next;
    next.icon = step == SetupStep::done ? Icon::save : Icon::next;
    std::string why;
    std::string words;
    if (step == SetupStep::done) {
        const Calibrations& c = input.calibrations;
        next.enabled = c.probe || c.needle || c.mannequin;
        if (!next.enabled) why = tr("Nothing to save yet");
        words = tr("Save calibration");
    } else {
        next.enabled = may_go_on(guide, input, why);
        words = std::string(tr("Next"));
        if (foot.w > 560)
            words += std::string(": ") + tr(setup_title(static_cast<SetupStep>(number + 1)));
    }
    next.primary = next.enabled;
    const Box box =
        foot.take_right(std::min(64 + ui.width(words, Type::bold), std::max(foot.w, 60.0f)), 12);
    const bool pressed = ui.button("next", box, words, next);
    if (!why.empty() && foot.w > 120) {
        const float high = std::min(ui.paragraph_height(foot.w, why, Type::small), foot.h);
        ui.paragraph({foot.x, foot.y + 0.5f * (foot.h - high), foot.w, high}, why, Type::small,
                     colour::kDim, true);
    }
    if (!pressed) return false;
    if (step == SetupStep::done) return true;
    guide.next();
    return false;
}

}  // namespace

SetupRequest draw_setup_page(Ui& ui,
                             Notices& notices,
                             SetupGuide& guide,
                             const SetupPageInput& input) {
    SetupRequest request;
    const Box window = ui.window();
    const PageLayout layout = page_layout(window.w, window.h);
    Box bar = layout.bar, content = layout.content;
    request.close = back_button(ui, bar, "scanning",
                                tr(input.over_result ? "Back to the result" : "Back to scanning"),
                                "The set-up stays as it is (F3)");
    if (!show_notice(notices, ui, bar)) ui.text(bar, tr("Set-up"), Type::heading);
    request.save =
        draw_foot(ui, content.take_bottom(layout.columns == 1 ? 48 : 56, 12), guide, input);
    if (layout.columns == 1) {
        draw_step_tabs(ui, content.take_top(44, 8), guide);
    } else {
        draw_step_list(ui, content.take_left(layout.columns > 2 ? 232 : 200, 16), guide);
    }
    if (content.w > 560) {
        const Box side = content.take_right(content.w > 800 ? 312 : 0.48f * content.w, 16);
        ui.card(side, "measure");
        draw_side(ui, side.inset(16, 12), guide, input, request);
    } else {
        const Box side = content.take_bottom(0.5f * content.h, 8);
        ui.card(side, "measure");
        draw_side(ui, side.inset(16, 12), guide, input, request);
    }
    ui.card(content, "step");
    draw_step(ui, content.inset(16, 12), guide, input);
    return request;
}

}  // namespace sonocase::runtime::inline player_ui
