// SPDX-License-Identifier: Apache-2.0

// The instructor's display: the trainee's picture with targets, outlines and names, the 3-D view,
// values, marks, events and the tracker, in exams too. It only shows: nothing on it changes
// what the trainee has.

#include "runtime/player/ui/instructor_window.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <string>
#include <vector>

#include <imgui.h>

#include "formats/exercise/metric_table.h"
#include "formats/scoring/draw_attempt.h"
#include "runtime/display/theme.h"
#include "runtime/player/app/shown_frame.h"
#include "runtime/player/session/png_file.h"
#include "runtime/player/ui/image_view.h"
#include "runtime/player/ui/pages.h"
#include "runtime/player/ui/panels.h"
#include "runtime/player/ui/parts/panel_parts.h"
#include "runtime/player/words/words.h"

namespace sonocase::runtime::inline player_ui {
namespace {

constexpr float kRow = 26;

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

void draw_head(const SessionView& session, Ui& ui, Box& room) {
    const CaseState& loaded = session.loaded;
    const Training& training = session.scan.training;
    const std::string title = loaded.texts().title;
    const float line = ui.line_height(Type::heading);
    const float high = std::min(ui.paragraph_height(room.w, title, Type::heading), 2 * line + 1);
    ui.paragraph(room.take_top(high, 2), title, Type::heading, colour::kText, true);
    const std::string who =
        session.progress.trainee.empty() ? tr("No name") : session.progress.trainee;
    ui.text(room.take_top(22, 4), who, Type::body, colour::kDim, Align::left, true);
    const bool exam = training.exam && (training.attempt || training.score);
    value(ui, room, "Kind",
          tr(session.scan.replay.runs() ? "Replay"
             : exam                     ? "EXAM"
             : training.attempt         ? "Practice"
                                        : "No attempt runs"));
    if (training.attempt)
        value(ui, room, "Total time", clock_words(training.attempt->view().seconds));
    if (training.attempt && !exam)
        value(ui, room, "Hints used", std::to_string(training.hints_shown));
    const int difficulty = attempt_difficulty(loaded.attempt_seed);
    if (training.attempt && difficulty != 0)
        value(ui, room, "Beside the exercise",
              tr(difficulty < -1    ? "much easier"
                 : difficulty == -1 ? "easier"
                 : difficulty == 1  ? "harder"
                                    : "much harder"));
}

void draw_values(const SessionView& session, Ui& ui, Box& room) {
    const FrameRecord& record = session.loaded.frame().record;
    const Training& training = session.scan.training;
    const bool needle = session.live && record.tools.has_needle;
    heading(ui, room, "Needle");
    const double mm = tip_to_target(session.loaded, record);
    if (!session.loaded.exercise().targets.empty())
        value(ui, room, "Tip to target", needle ? text("%.0f mm", mm) : "–");
    value(ui, room, "Needle depth",
          needle && record.needle.depth_mm > 0 ? text("%.0f mm", record.needle.depth_mm) : "–");
    if (!training.attempt) return;
    const AttemptView view = training.attempt->view();
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
void draw_marks(const SessionView& session, Ui& ui, Box& room) {
    const Training& training = session.scan.training;
    heading(ui, room, "Pass marks");
    if (training.result && !training.attempt) {
        for (const ResultRow& row : training.result->rows) {
            if (row.has_limit)
                mark_row(ui, room, row.title, metric_words(row.metric, row.value),
                         row.reached ? Icon::pass : Icon::fail);
        }
        return;
    }
    for (const Exercise::PassMark& mark : session.loaded.exercise().pass_marks) {
        const MetricInfo* info = find_metric(mark.metric);
        const bool most = std::isfinite(mark.at_most);
        mark_row(ui, room, info ? info->title : mark.metric.c_str(),
                 std::string(tr(most ? "at most" : "at least")) + " " +
                     metric_words(mark.metric, most ? mark.at_most : mark.at_least),
                 Icon::none);
    }
}

void draw_events(const Training& training, Ui& ui, Box& room) {
    if (!training.attempt) return;
    const AttemptView view = training.attempt->view();
    if (view.events.empty()) return;
    heading(ui, room, "Events");
    for (auto event = view.events.rbegin(); event != view.events.rend() && room.h >= 20; ++event)
        ui.text(room.take_top(20), tr_message(*event), Type::small, colour::kDim, Align::left,
                true);
}

void draw_tracker(Ui& ui, Box& room, const TrackerHealth& tracker, bool live) {
    if (room.h < 2 * kRow) return;
    heading(ui, room, "Tracker");
    Box line = room.take_top(kRow);
    ui.icon(live ? Icon::link : Icon::lost, line.x, line.y + 4, 18,
            live ? colour::kGood : colour::kWarn);
    line.take_left(26);
    const std::string device =
        tracker.device.empty() ? tr("No tracker") : tr_message(tracker.device);
    ui.text(line, live ? device : device + " · " + tr("not seen"), Type::small,
            live ? colour::kText : colour::kWarn, Align::left, true);
    if (!tracker.message.empty() && room.h >= 20)
        ui.paragraph(room, tr_message(tracker.message), Type::small, colour::kDim, true);
}

// The frame shown, outlined, in the texture of this window.
void update_picture(Notices& notices, CaseState& loaded, InstructorView& own) {
    const ScanFrame& frame = loaded.frame();
    if (!own.picture) own.picture = std::make_unique<ImageTexture>();
    if (own.frame != frame.number) {
        own.frame = frame.number;
        if (outline_frame(notices, loaded, own.rgb, own.names)) {
            own.picture->upload_rgb(own.rgb, frame.width_px, frame.height_px);
        } else if (frame.width_px > 0) {
            own.picture->upload(frame.pixels, frame.width_px, frame.height_px);
        }
    }
}

void draw_picture(const SessionView& session, const ViewState& view, Ui& ui, const Box& area) {
    const CaseState& loaded = session.loaded;
    const ScanFrame& frame = loaded.frame();
    const InstructorView& own = view.display.instructor;
    const ScanControls& controls = session.scan.console.controls;
    const ImageSettings& image = controls.settings;
    const Measurements none;
    const bool begun = view.tools.measurements.begun().has_value();
    ImageViewInput input{frame, own.picture->empty() ? nullptr : own.picture->id(),
                         loaded.exercise().probe, begun ? none : view.tools.measurements};
    input.flipped = image.flip_left_right;
    if (image.doppler.mode != DopplerMode::off) input.doppler = &image.doppler;
    if (!view.display.strip->empty()) input.strip = view.display.strip->id();
    for (const TissueName& name : own.names)
        input.names.push_back({name.column, name.row, name.words});
    if (!session.live && !controls.frozen)
        input.stopped = session.tracker.message.empty() ? tr("No reading from the tracker yet")
                                                        : tr_message(session.tracker.message);
    input.stopped_buttons = false;
    input.left_lines = {std::string(tr("Depth")) +
                        text(" %.0f cm", loaded.engine.image.depth_mm / 10)};
    const ImagePlace place = draw_image_view(ui, area, input);
    if (frame.width_px <= 0 || !frame.record.tools.has_probe || !input.stopped.empty()) return;
    const Rigid probe_from_mannequin = inverse(frame.record.tools.mannequin_from_probe);
    const std::vector<Point3> centres = loaded.target_centres();
    std::vector<TargetMark> targets;
    for (std::size_t i = 0; i < centres.size(); ++i) {
        const Target& target = loaded.exercise().targets[i];
        targets.push_back(
            {probe_from_mannequin * centres[i], target.radius_mm, tissue_words(target.name)});
    }
    ui.clip(area);
    draw_target_marks(ui, place, targets, input.flipped);
    ui.unclip();
}

void draw_view(const SessionView& session, const ImageTexture& texture, Ui& ui, const Box& card) {
    const CaseState& loaded = session.loaded;
    const ScanState& scan = session.scan;
    const std::vector<Point3> centres = loaded.target_centres();
    const std::vector<Point3> none;
    const bool replay = scan.replay.runs();
    draw_other_view3d(ui, *loaded.view3d,
                      {.frame = loaded.frame(),
                       .texture = texture,
                       .target_centres = centres,
                       .targets_reached = scan.training.targets_reached,
                       .shows_targets = true,
                       .exam = false,
                       .flipped = scan.console.controls.settings.flip_left_right,
                       .now_s = session.now_s,
                       .skin = *loaded.skin,
                       .mouse = nullptr,
                       .path = replay ? scan.replay.tip_path : none,
                       .best = replay ? scan.replay.best_way : none},
                      card);
}

void draw_instructor_page(const SessionView& session, const ViewState& view, bool empty, Ui& ui) {
    begin_page();
    const Box window = ui.window();
    Box area = window.inset(8);
    if (empty) {
        ui.card(area, "empty");
        ui.paragraph(area.inset(24), tr("The instructor's display: no case is open."), Type::body,
                     colour::kDim, true);
        end_page(ui);
        return;
    }
    Box left = area.take_left(std::clamp(0.23f * window.w, 260.0f, 400.0f), 8);
    Box right;
    if (window.w >= 1180) right = area.take_right(288, 8);
    draw_view(session, *view.display.texture, ui, left.take_bottom(std::floor(0.42f * left.h), 8));
    ui.card(left, "attempt");
    Box room = left.inset(12);
    draw_head(session, ui, room);
    room.take_top(8);
    draw_values(session, ui, room);
    draw_picture(session, view, ui, area);
    if (!right.empty()) {
        ui.card(right, "marks");
        room = right.inset(12);
        draw_marks(session, ui, room);
        room.take_top(8);
        draw_events(session.scan.training, ui, room);
        room.take_top(8);
        draw_tracker(ui, room, session.tracker, session.live);
    }
    end_page(ui);
}

// The largest scale that leaves the room that the page needs.
float fitting_scale(int width_px, int height_px) {
    const float fits =
        std::min(static_cast<float>(width_px) / 1200, static_cast<float>(height_px) / 660);
    return std::clamp(fits, 0.75f, 4.0f);
}

void open_or_close(Notices& notices, const Window& main, InstructorView& view) {
    if (view.window && view.window->shown() && view.window->should_close()) view.wanted = false;
    if (view.window) {
        view.window->show(view.wanted);
        return;
    }
    if (!view.wanted) return;
    const Window::Size size = main.size();
    auto opened =
        SecondWindow::open(main, tr("Instructor's display"), size.width_px, size.height_px);
    if (!opened) {
        notices.error(opened.error().message());
        view.wanted = false;
        return;
    }
    view.window = std::move(*opened);
    view.frame = 0;
}

}  // namespace

Status follow_instructor_window(const SessionView& session,
                                Notices& notices,
                                CaseState& loaded,
                                ViewState& view,
                                Ui& ui,
                                const std::string& shot) {
    InstructorView& own = view.display.instructor;
    open_or_close(notices, *view.display.window, own);
    if (!own.window || !own.window->shown()) return Done{};
    if (!own.pace.due(session.now_s) && shot.empty()) return Done{};
    own.window->begin_frame(fitting_scale);
    ui.begin(own.window->scale(), session.now_s);
    const bool empty = !loaded.open || view.display.texture->empty();
    if (!empty) update_picture(notices, loaded, own);
    draw_instructor_page(session, view, empty, ui);
    own.window->end_frame(!shot.empty());
    if (shot.empty()) return Done{};
    const Window::Capture& picture = own.window->captured();
    if (Status saved = write_png(shot, picture.width_px, picture.height_px, 3, picture.pixels);
        !saved)
        return saved;
    return write_boxes(ui, shot);
}

}  // namespace sonocase::runtime::inline player_ui
