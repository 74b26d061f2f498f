// SPDX-License-Identifier: Apache-2.0

// The instructor's display: the trainee's picture with targets, outlines and names, the 3-D view,
// values, marks, events and the tracker, in exams too. It is only looked at: nothing on it changes
// what the trainee has.
#include <algorithm>
#include <cmath>
#include <cstdio>

#include "formats/attempt/difficulty.h"
#include "formats/exercise/metric_table.h"
#include "runtime/player/app/attempt_steps.h"
#include "runtime/player/app/shown_frame.h"
#include "runtime/player/ui/pages/pages.h"
#include "runtime/player/ui/panels/panels.h"
#include "runtime/player/ui/parts/panel_parts.h"
#include "runtime/player/ui/picture/target_marks.h"
#include "runtime/player/words/said.h"
#include "runtime/player/words/words.h"

namespace sonocase::runtime {
namespace {

constexpr float kRow = 26;

std::string clock_words(double seconds) {
    char words[32];
    const int whole = static_cast<int>(seconds);
    std::snprintf(words, sizeof words, "%d:%02d", whole / 60, whole % 60);
    return words;
}

void value(Ui& ui,
           Box& room,
           const char* name,
           const std::string& words,
           unsigned packed = colour::kText) {
    if (room.h >= kRow) ui.row(room.take_top(kRow), tr(name), words, packed);
}

void heading(Ui& ui, Box& room, const char* words) {
    if (room.h >= kRow) ui.text(room.take_top(kRow, 2), tr(words), Type::bold);
}

double tip_to_target(const CaseState& loaded, const FrameRecord& record) {
    const Point3 tip = record.needle.mannequin_from_drawn * Point3{0, 0, 0};
    double nearest = 1e9;
    for (const Point3& centre : loaded.target_centres())
        nearest = std::min(nearest, distance(tip, centre));
    return nearest;
}

void draw_head(const App& app, Ui& ui, Box& room) {
    const CaseState& loaded = app.loaded;
    const Exercise& exercise = loaded.exercise();
    const std::string title = exercise.title.empty() ? exercise.name : exercise.title;
    const float line = ui.line_height(Type::heading);
    const float high = std::min(ui.paragraph_height(room.w, title, Type::heading), 2 * line + 1);
    ui.paragraph(room.take_top(high, 2), title, Type::heading, colour::kText, true);
    const std::string who = app.player.trainee.empty() ? tr("No name") : app.player.trainee;
    ui.text(room.take_top(22, 4), who, Type::body, colour::kDim, Align::left, true);
    const bool exam = app.scan.exam && (app.scan.attempt || app.scan.score);
    value(ui, room, "Kind",
          tr(replays(app.scan)  ? "Replay"
             : exam             ? "EXAM"
             : app.scan.attempt ? "Practice"
                                : "No attempt runs"));
    if (app.scan.attempt)
        value(ui, room, "Total time", clock_words(app.scan.attempt->view().seconds));
    if (app.scan.attempt && !exam)
        value(ui, room, "Hints used", std::to_string(app.scan.hints_shown));
    const int difficulty = attempt_difficulty(loaded.attempt_seed);
    if (app.scan.attempt && difficulty != 0)
        value(ui, room, "Beside the exercise",
              tr(difficulty < -1    ? "much easier"
                 : difficulty == -1 ? "easier"
                 : difficulty == 1  ? "harder"
                                    : "much harder"));
}

void draw_values(const App& app, Ui& ui, Box& room, bool live) {
    const FrameRecord& record = app.loaded.frame().record;
    const bool needle = live && record.tools.has_needle;
    heading(ui, room, "Needle");
    const double mm = tip_to_target(app.loaded, record);
    if (!app.loaded.exercise().targets.empty())
        value(ui, room, "Tip to target", needle ? text("%.0f mm", mm) : "–");
    value(ui, room, "Needle depth",
          needle && record.needle.depth_mm > 0 ? text("%.0f mm", record.needle.depth_mm) : "–");
    if (!app.scan.attempt) return;
    const AttemptView view = app.scan.attempt->view();
    const bool inside = needle && view.depth_mm > 0;
    value(ui, room, "Tip in view", !inside ? "–" : tr(view.tip_in_view ? "Yes" : "No"),
          !inside            ? colour::kDim
          : view.tip_in_view ? colour::kGood
                             : colour::kWarn);
    value(ui, room, "Skin punctures", std::to_string(view.insertions));
    if (view.in_no_go && room.h >= kRow) {
        const Box line = room.take_top(kRow);
        ui.icon(Icon::warn, line.x, line.y + 4, 18, colour::kBad);
        ui.text({line.x + 24, line.y, line.w - 24, line.h}, tr("Critical structure touched"),
                Type::small, colour::kBad, Align::left, true);
    }
}

// A mark: its name over as many lines as it needs, its value at the right.
void mark_row(Ui& ui, Box& room, const char* name, const std::string& words, Icon icon) {
    const float wide = ui.width(words, Type::bold) + 8;
    const float left = icon == Icon::none ? 0 : 26;
    const float high = ui.paragraph_height(room.w - wide - left, tr(name), Type::small);
    if (room.h < high + 8) return;
    Box line = room.take_top(high + 8);
    if (left > 0) {
        ui.icon(icon, line.x, line.y + 4, 18, icon == Icon::pass ? colour::kGood : colour::kBad);
        line.take_left(left);
    }
    const Box at_right = line.take_right(wide);
    ui.text(at_right, words, Type::bold, colour::kText, Align::right);
    ui.paragraph({line.x, line.y + 4, line.w, high}, tr(name), Type::small, colour::kDim, true);
}

// Before and during an attempt what is needed; afterwards what was reached.
void draw_marks(const App& app, Ui& ui, Box& room) {
    heading(ui, room, "Pass marks");
    if (app.scan.result && !app.scan.attempt) {
        for (const ResultRow& row : app.scan.result->rows) {
            if (row.has_limit)
                mark_row(ui, room, row.title, metric_words(row.metric, row.value),
                         row.reached ? Icon::pass : Icon::fail);
        }
        return;
    }
    for (const Exercise::PassMark& mark : app.loaded.exercise().pass_marks) {
        const MetricInfo* info = find_metric(mark.metric);
        const bool most = std::isfinite(mark.at_most);
        mark_row(ui, room, info ? info->title : mark.metric.c_str(),
                 std::string(tr(most ? "at most" : "at least")) + " " +
                     metric_words(mark.metric, most ? mark.at_most : mark.at_least),
                 Icon::none);
    }
}

void draw_events(const App& app, Ui& ui, Box& room) {
    if (!app.scan.attempt) return;
    const AttemptView view = app.scan.attempt->view();
    if (view.events.empty()) return;
    heading(ui, room, "Events");
    for (auto event = view.events.rbegin(); event != view.events.rend() && room.h >= 20; ++event)
        ui.text(room.take_top(20), tr_said(*event), Type::small, colour::kDim, Align::left, true);
}

void draw_tracker(Ui& ui, Box& room, const TrackerHealth& tracker, bool live) {
    if (room.h < 2 * kRow) return;
    heading(ui, room, "Tracker");
    Box line = room.take_top(kRow);
    ui.icon(live ? Icon::link : Icon::lost, line.x, line.y + 4, 18,
            live ? colour::kGood : colour::kWarn);
    line.take_left(26);
    const std::string device = tracker.device.empty() ? tr("No tracker") : tr_said(tracker.device);
    ui.text(line, live ? device : device + " · " + tr("not seen"), Type::small,
            live ? colour::kText : colour::kWarn, Align::left, true);
    if (!tracker.message.empty() && room.h >= 20)
        ui.paragraph(room, tr_said(tracker.message), Type::small, colour::kDim, true);
}

void draw_picture(App& app, Ui& ui, const Box& area, const TrackerHealth& tracker, bool live) {
    const CaseState& loaded = app.loaded;
    const ScanFrame& frame = loaded.frame();
    InstructorView& own = app.view.instructor;
    const ImageSettings& image = app.scan.controls.settings;
    if (!own.picture) own.picture = std::make_unique<ImageTexture>();
    if (own.frame != frame.number) {
        own.frame = frame.number;
        if (outline_frame(app, own.rgb, own.names)) {
            own.picture->upload_rgb(own.rgb, frame.width_px, frame.height_px);
        } else if (frame.width_px > 0) {
            own.picture->upload(frame.pixels, frame.width_px, frame.height_px);
        }
    }
    const Measurements none;
    const bool begun = app.view.measurements.begun().has_value();
    ImageViewInput input{frame, own.picture->empty() ? nullptr : own.picture->id(),
                         loaded.exercise().probe, begun ? none : app.view.measurements};
    input.flipped = image.flip_left_right;
    if (image.doppler.mode != DopplerMode::off) input.doppler = &image.doppler;
    if (!app.view.strip->empty()) input.strip = app.view.strip->id();
    for (const TissueName& name : own.names)
        input.names.push_back({name.column, name.row, name.words});
    if (!live && !app.scan.controls.frozen)
        input.stopped = tracker.message.empty() ? tr("No reading from the tracker yet")
                                                : tr_said(tracker.message);
    input.left_lines = {std::string(tr("Depth")) + text(" %.0f cm", loaded.image.depth_mm / 10)};
    const ImagePlace place = draw_image_view(ui, area, input);
    if (frame.width_px <= 0 || !frame.record.tools.has_probe || !input.stopped.empty()) return;
    const Rigid probe_from_mannequin = inverse(frame.record.tools.mannequin_from_probe);
    const std::vector<Point3> centres = loaded.target_centres();
    std::vector<TargetMark> targets;
    for (std::size_t i = 0; i < centres.size(); ++i) {
        const Target& target = loaded.exercise().targets[i];
        targets.push_back({probe_from_mannequin * centres[i], target.radius_mm,
                           i < app.scan.targets_reached.size() && app.scan.targets_reached[i],
                           tissue_words(target.name)});
    }
    ui.clip(area);
    draw_target_marks(ui, place, targets, input.flipped);
    ui.unclip();
}

void draw_view(App& app, Ui& ui, const Box& card) {
    const CaseState& loaded = app.loaded;
    const std::vector<Point3> centres = loaded.target_centres();
    const std::vector<Point3> none;
    const bool replay = replays(app.scan);
    const View3dPanelInput input{loaded.frame(),
                                 *app.view.texture,
                                 centres,
                                 app.scan.targets_reached,
                                 true,
                                 false,
                                 app.scan.controls.settings.flip_left_right,
                                 app.player.now_s,
                                 *loaded.skin,
                                 nullptr,
                                 replay ? app.scan.tip_path : none,
                                 replay ? app.scan.best_way : none};
    draw_other_view3d(ui, *app.view.small_view.view, input, card);
}

}  // namespace

void draw_instructor_page(App& app, Ui& ui, const TrackerHealth& tracker) {
    begin_page();
    const Box window = ui.window();
    Box area = window.inset(8);
    if (!app.loaded.open || app.view.texture->empty()) {
        ui.card(area, "empty");
        ui.paragraph(area.inset(24), tr("The instructor's display: no case is open."), Type::body,
                     colour::kDim, true);
    } else {
        const bool live = tracker_is_live(app, tracker);
        Box left = area.take_left(std::clamp(0.23f * window.w, 260.0f, 400.0f), 8);
        Box right;
        if (window.w >= 1180) right = area.take_right(288, 8);
        const Box view = left.take_bottom(std::floor(0.42f * left.h), 8);
        draw_view(app, ui, view);
        ui.card(left, "attempt");
        Box room = left.inset(12);
        draw_head(app, ui, room);
        room.take_top(8);
        draw_values(app, ui, room, live);
        draw_picture(app, ui, area, tracker, live);
        if (!right.empty()) {
            ui.card(right, "marks");
            room = right.inset(12);
            draw_marks(app, ui, room);
            room.take_top(8);
            draw_events(app, ui, room);
            room.take_top(8);
            draw_tracker(ui, room, tracker, live);
        }
    }
    end_page(ui);
}

}  // namespace sonocase::runtime
