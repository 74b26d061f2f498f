// SPDX-License-Identifier: Apache-2.0

#include "runtime/player/ui/player_window.h"

#include <algorithm>
#include <utility>

#include <imgui.h>

#include "runtime/player/app/attempt_steps.h"
#include "runtime/player/app/case_steps.h"
#include "runtime/player/app/exam_set.h"
#include "runtime/player/app/own_exercises.h"
#include "runtime/player/app/saved_pictures.h"
#include "runtime/player/app/shown_frame.h"
#include "runtime/player/app/sound_steps.h"
#include "runtime/player/app/tracker_steps.h"
#include "runtime/player/ui/panels.h"

namespace sonocase::runtime::inline player_ui {

SessionView PlayerWindow::session(const TrackerHealth& tracker) const {
    return {.settings = player_.settings,
            .serve = player_.arguments.serve,
            .progress = player_.progress,
            .loaded = loaded_,
            .scan = scan_,
            .tracker = tracker,
            .live = tracker_is_live(loaded_, scan_.tracker, tracker),
            .now_s = player_.now_s};
}

// Once per picture of the scanning page: targets, the guided start, and a replay.
void PlayerWindow::follow_session() {
    const FrameRecord& record = loaded_.frame().record;
    Training& training = scan_.training;
    // The last picture before an attempt shows the targets where they were.
    const bool current =
        loaded_.frame().rendered_s > training.attempt_from_s && !scan_.console.controls.frozen;
    if (current)
        mark_targets_reached(loaded_.exercise(), record, loaded_.target_centres(),
                             training.targets_reached);
    if (training.attempt && current)
        note_steps(loaded_.exercise(), loaded_.engine.anatomy.get(), record,
                   loaded_.target_centres(), training.steps_done);
    if (training.guide) {
        training.guide->observe({.has_probe = record.tools.has_probe,
                                 .mannequin_from_probe = record.tools.mannequin_from_probe,
                                 .frozen = scan_.console.controls.frozen,
                                 .has_needle = record.tools.has_needle,
                                 .needle_depth_mm = record.needle.depth_mm});
    }
    follow_replay(player_.notices, loaded_, scan_);
}

void PlayerWindow::show_setup(const TrackerHealth& tracker) {
    const SensorAssignment& assignment = scan_.console.controls.assignment;
    SetUp& set_up = loaded_.set_up;
    follow_setup(loaded_, assignment, player_.now_s);
    const SetupRequest wanted =
        draw_setup_page(ui_, player_.notices, *set_up.guide,
                        {.tracker = tracker,
                         .reading = loaded_.frame().reading,
                         .assignment = assignment,
                         .live = tracker_is_live(loaded_, scan_.tracker, tracker),
                         .calibrations = set_up.calibrations,
                         .picture = *view_.display.texture,
                         .width_px = loaded_.frame().width_px,
                         .height_px = loaded_.frame().height_px,
                         .over_result = view_.screen.page == Page::after});
    if (wanted.role)
        give_role(player_, loaded_, scan_.tracker, tracker.sensors, wanted.role->first,
                  wanted.role->second);
    const bool saved =
        wanted.save && save_calibrations(set_up.calibrations, player_.settings, player_.notices);
    if (wanted.close || saved) view_.screen.show_setup = false;
}

void PlayerWindow::draw_page(const TrackerHealth& tracker) {
    Screen& screen = view_.screen;
    begin_page();
    if (screen.page == Page::course && player_.progress.courses.empty())
        screen.page = Page::bundles;
    if (!loaded_.open && screen.page != Page::group && screen.page != Page::course)
        screen.page = Page::bundles;
    if (screen.page == Page::after && !scan_.training.result) screen.page = Page::scan;
    const SessionView session = this->session(tracker);
    switch (screen.page) {
        case Page::bundles:
            draw_start_page(player_.progress, player_.notices, view_.chooser, screen, ui_,
                            requests_);
            break;
        case Page::scan:
            follow_session();
            if (screen.show_setup) {
                show_setup(tracker);
            } else {
                draw_scan_page(session, player_.notices, scan_.console, view_, ui_, requests_);
            }
            break;
        case Page::after:
            note_exam_result(scan_.training);
            if (screen.show_setup) {
                show_setup(tracker);
            } else {
                draw_after_page(session, player_.notices, screen, ui_, requests_);
            }
            break;
        case Page::course:
            draw_course_page(player_.progress, player_.notices, view_.chooser, view_.course_page,
                             screen, ui_, requests_);
            break;
        case Page::group:
            draw_class_page(player_, view_.class_page, view_.chooser, session.case_open(), screen,
                            ui_, requests_);
            break;
    }
    ImGui::End();
    draw_dialogs(session, player_, view_, ui_, requests_);
    ui_.end();
}

void PlayerWindow::show_bundles() {
    view_.chooser.bundles = find_bundles(player_.settings.recent);
    player_.progress.courses = find_courses(player_.arguments.course, player_.notices);
    player_.progress.course = std::min(
        player_.progress.course, std::max<std::size_t>(player_.progress.courses.size(), 1) - 1);
    view_.chooser.asked = false;
    view_.screen.dialog = Dialog::none;
    view_.screen.page = Page::bundles;
}

// A request may lead to another one.
void PlayerWindow::carry_out_requests() {
    for (const Request& request : std::exchange(requests_, {}))
        std::visit([this](const auto& wanted) { carry_out(wanted); }, request);
}

void PlayerWindow::carry_out(const request::OpenCase& wanted) {
    using Then = request::OpenCase::Then;
    if (open_bundle(player_, loaded_, scan_, wanted.path, wanted.exercise)) {
        view_.hover = {};
        view_.screen.page = Page::scan;
        view_.display.window->set_title(loaded_.name() + " - sonocase");
        if (wanted.typed) view_.chooser.typing = false;
        if (wanted.then == Then::practise || wanted.then == Then::exam)
            start_attempt(player_, loaded_, scan_, "", wanted.then == Then::exam);
        if (wanted.then == Then::expert) (void)watch_expert(player_, loaded_, scan_, wanted.sweep);
        view_.screen.in_course = wanted.in_course;
    }
    if (wanted.then == Then::guide && loaded_.open) scan_.training.guide.emplace();
}

void PlayerWindow::carry_out(const request::AnswerCourse& wanted) {
    answer_course(player_, wanted.module, wanted.option);
}

void PlayerWindow::carry_out(const request::ShowCases& wanted) {
    if (!may_leave_attempt(player_, scan_.training, wanted.asked_by)) return;
    finish_attempt(player_, loaded_, scan_);
    show_bundles();
}

void PlayerWindow::carry_out(const request::Quit& wanted) {
    if (may_leave_attempt(player_, scan_.training, wanted.asked_by))
        view_.display.window->request_close();
}

void PlayerWindow::carry_out(const request::ChooseExercise& wanted) {
    if (!may_leave_attempt(player_, scan_.training, wanted.asked_by)) return;
    choose_exercise(player_, loaded_, scan_, wanted.index);
    view_.screen.page = Page::scan;
    if (wanted.close_dialog) view_.screen.dialog = Dialog::none;
}

void PlayerWindow::carry_out(const request::ToggleAttempt&) {
    Screen& screen = view_.screen;
    screen.put_off = -1;
    if (toggle_attempt(player_, loaded_, scan_)) {
        screen.page = Page::after;
        screen.after = {};
    } else {
        screen.page = Page::scan;
    }
}

void PlayerWindow::carry_out(const request::NextHint&) {
    show_next_hint(player_.notices, loaded_, scan_.training);
    if (!scan_.training.attempt || scan_.training.in_exam()) return;
    const Procedure& procedure = loaded_.exercise().procedure;
    if (!procedure.given()) return;
    // It is read in the place of the questions that are asked now; they wait.
    const ProcedureState& state = loaded_.frame().procedure.state;
    int& put_off = view_.screen.put_off;
    for (int next; (next = next_question(procedure, state, put_off)) >= 0;) put_off = next;
}

void PlayerWindow::carry_out(const request::SkipGuide&) {
    if (scan_.training.guide) scan_.training.guide->skip();
}

void PlayerWindow::carry_out(const request::StartReplay& wanted) {
    if (!start_replay(player_, loaded_, scan_)) return;
    view_.screen.page = Page::scan;
    if (wanted.from_s > 0) scan_.tracker.paced->jump(wanted.from_s);
}

void PlayerWindow::carry_out(const request::PerformAct& wanted) {
    loaded_.scan->with_engine([&](ScanEngine& engine) { (void)engine.act(wanted.act); });
}

void PlayerWindow::carry_out(const request::EndReplay&) {
    end_replay(player_, loaded_, scan_);
    // Of an expert there is no result.
    view_.screen.page =
        view_.screen.in_course && !scan_.training.result ? Page::course : Page::after;
}

void PlayerWindow::carry_out(const request::OpenReview&) {
    open_review(player_.notices, loaded_, scan_.training);
}

void PlayerWindow::carry_out(const request::StartExamSet&) {
    start_exam_set(player_, loaded_, scan_);
    view_.screen.dialog = Dialog::none;
    view_.screen.page = Page::scan;
}

void PlayerWindow::carry_out(const request::GoOnWithExamSet&) {
    go_on_with_exam_set(player_, loaded_, scan_);
    view_.screen.page = Page::scan;
}

void PlayerWindow::carry_out(const request::ChooseTracker& wanted) {
    choose_tracker(player_, loaded_, scan_.tracker, wanted.spec);
}

void PlayerWindow::carry_out(const request::GoOnWithMouse&) {
    finish_attempt(player_, loaded_, scan_);
    choose_tracker(player_, loaded_, scan_.tracker, "mouse");
}

void PlayerWindow::carry_out(const request::StepTracker& wanted) {
    step_tracker(player_, loaded_, scan_.tracker, wanted.back);
}

void PlayerWindow::carry_out(const request::ToggleNeedle& wanted) {
    toggle_needle(scan_.tracker, loaded_.exercise().probe, wanted.in_plane, player_.notices);
}

void PlayerWindow::carry_out(const request::ChooseModel& wanted) {
    loaded_.engine.image.machine = wanted.machine;
    choose_model(player_, loaded_, scan_.console, wanted.model);
}

void PlayerWindow::carry_out(const request::ChangeDepth& wanted) {
    change_depth(player_, loaded_, scan_.console, wanted.by_mm);
}

void PlayerWindow::carry_out(const request::ChangeFocus& wanted) {
    change_focus(player_, loaded_, scan_.console, wanted.by_mm);
}

void PlayerWindow::carry_out(const request::ChoosePreset& wanted) {
    choose_preset(player_, loaded_, scan_.console, *wanted.preset);
}

void PlayerWindow::carry_out(const request::ChooseMode& wanted) {
    choose_mode(player_.notices, loaded_, scan_.console, wanted.mode);
}

void PlayerWindow::carry_out(const request::AimDoppler&) {
    aim_doppler(player_.notices, loaded_, scan_.console);
}

void PlayerWindow::carry_out(const request::FitImage& wanted) {
    fit_image(player_, loaded_, scan_.console, wanted.width_px, wanted.height_px);
}

void PlayerWindow::carry_out(const request::ToggleSound&) {
    toggle_sound(player_, scan_.sounds);
}

void PlayerWindow::carry_out(const request::SavePicture&) {
    save_picture(player_.notices, loaded_);
}

void PlayerWindow::carry_out(const request::SaveClip&) {
    start_clip(player_.notices, loaded_, scan_.console);
}

void PlayerWindow::carry_out(const request::NamePixel& wanted) {
    if (may_name_tissue(scan_))
        view_.hover.picked = name_of_pixel(player_.notices, loaded_, wanted.column, wanted.row);
}

void PlayerWindow::carry_out(const request::BeginNewTarget&) {
    begin_new_target(player_.notices, scan_.training, view_.educator, view_.screen);
}

void PlayerWindow::carry_out(const request::PlaceNewTarget& wanted) {
    NewTarget& target = view_.educator.new_target;
    set_new_target(player_.notices, loaded_, target, wanted.x_mm, wanted.z_mm);
    if (target.placed) view_.screen.dialog = Dialog::new_target;
}

void PlayerWindow::carry_out(const request::SaveNewTarget&) {
    const auto index = save_new_target(player_.notices, loaded_, view_.educator.new_target);
    if (!index) return;
    view_.screen.dialog = Dialog::none;
    choose_exercise(player_, loaded_, scan_, *index);
}

void PlayerWindow::carry_out(const request::SaveMarks&) {
    const auto index = save_marks(player_.notices, loaded_, scan_.training, view_.educator.marks);
    if (!index) return;
    view_.screen.dialog = Dialog::none;
    choose_exercise(player_, loaded_, scan_, *index);
}

}  // namespace sonocase::runtime::inline player_ui
