// SPDX-License-Identifier: Apache-2.0

// The scanning page: puts the panels where the layout says, and lets the mouse on the picture move
// the tools, measure, or set what the user has chosen to set.

#include <algorithm>
#include <cmath>

#include <imgui.h>

#include "formats/scoring/draw_attempt.h"
#include "runtime/player/app/attempt_steps.h"
#include "runtime/player/app/case_steps.h"
#include "runtime/player/app/picture_marks.h"
#include "runtime/player/app/states.h"
#include "runtime/player/ui/doppler_marks.h"
#include "runtime/player/ui/image_view.h"
#include "runtime/player/ui/pages.h"
#include "runtime/player/ui/panels.h"
#include "runtime/player/ui/parts/layout.h"
#include "runtime/player/ui/parts/panel_parts.h"
#include "runtime/player/words/words.h"
#include "runtime/tracking/mouse_tracker.h"

namespace sonocase::runtime::inline player_ui {

namespace {

// Once per picture, after the picture was drawn.
// place    as draw_image_view returned it
// tracker  whose tools move; null if the mouse is not the tracker
void handle_picture_mouse(const ImagePlace& place,
                          bool flipped,
                          bool measuring,
                          Measurements& measurements,
                          MouseTracker* tracker) {
    const ImGuiIO& io = ImGui::GetIO();
    if (!place.hovered) return;
    const double mm = place.mm_per_screen_px;
    const double flip = flipped ? -1 : 1;
    if (measuring) {
        if (ImGui::IsMouseClicked(0)) {
            measurements.click((io.MousePos.x - place.origin_x) * mm,
                               (io.MousePos.y - place.origin_y) * mm);
        }
        return;
    }
    if (!tracker) return;
    MouseTracker& mouse = *tracker;
    const double dx = io.MouseDelta.x, dy = io.MouseDelta.y;
    const bool needle = mouse.has_needle() && (io.KeyShift || ImGui::IsMouseDown(2));
    if (ImGui::IsMouseDown(0) && !io.KeyShift && (dx != 0 || dy != 0)) {
        // The picture follows the hand: to drag tissue right the probe slides left.
        mouse.slide(-flip * dx * mm, dy * mm);
    }
    if (ImGui::IsMouseDown(1) && (dx != 0 || dy != 0)) {
        mouse.rock(-flip * dx * 0.004);
        mouse.fan(-dy * 0.004);
    }
    if (needle && (ImGui::IsMouseDown(2) || ImGui::IsMouseDown(0)) && (dx != 0 || dy != 0)) {
        mouse.aim_needle(-flip * dx * 0.003, dy * 0.003);
    }
    if (io.MouseWheel != 0) {
        if (io.KeyShift && mouse.has_needle()) {
            mouse.advance_needle(2 * io.MouseWheel);
        } else if (io.KeyCtrl) {
            mouse.press(-io.MouseWheel);
        } else {
            mouse.rotate(0.05 * io.MouseWheel);
        }
    }
}

// In a Doppler mode: what the left button takes hold of, box, its corner or the gate, follows the
// mouse. True: the mouse is taken, and moves nothing else.
bool handle_doppler_mouse(const CaseState& loaded,
                          ImageSettings& image,
                          PictureTools& tools,
                          const ImagePlace& place,
                          float scale) {
    DopplerSettings& settings = image.doppler;
    DopplerDrag& drag = tools.doppler_drag;
    if (settings.mode == DopplerMode::off || tools.measuring || !ImGui::IsMouseDown(0)) {
        drag = DopplerDrag::none;
        return false;
    }
    if (drag == DopplerDrag::none && !(place.hovered && ImGui::IsMouseClicked(0))) return false;
    const ImGuiIO& io = ImGui::GetIO();
    const bool flipped = image.flip_left_right;
    const ScanGeometry geometry = picture_geometry(loaded.frame(), loaded.exercise().probe);
    if (drag == DopplerDrag::none)
        drag =
            doppler_hold(place, geometry, settings, flipped, io.MousePos.x, io.MousePos.y, scale);
    drag_doppler(place, geometry, drag, flipped, io.MousePos.x - io.MouseDelta.x,
                 io.MousePos.y - io.MouseDelta.y, io.MousePos.x, io.MousePos.y, settings);
    return drag != DopplerDrag::none;
}

// Zoom, words and body mark. area: of the picture, u. True: the mouse is taken.
bool handle_marks_mouse(
    PictureMarks& marks, Screen& screen, const ImagePlace& place, const Box& area, float scale) {
    const ImVec2 mouse = ImGui::GetIO().MousePos;
    const double mm = place.mm_per_screen_px;
    const auto x_mm = [&](float x) { return (x - place.origin_x) * mm; };
    const auto z_mm = [&](float y) { return (y - place.origin_y) * mm; };
    const bool clicked = place.hovered && ImGui::IsMouseClicked(0);
    const Box body = body_mark_box(area);
    const float u = (mouse.x / scale - body.x) / body.w, v = (mouse.y / scale - body.y) / body.h;
    if (marks.body && clicked && u >= 0 && u <= 1 && v >= 0 && v <= 1) {
        marks.body_x = u;
        marks.body_y = v;
        return true;
    }
    switch (marks.tool) {
        case MarkTool::none: return false;
        case MarkTool::label:
            if (!clicked) return true;
            marks.placing = {x_mm(mouse.x), z_mm(mouse.y), ""};
            screen.dialog = Dialog::label;
            return true;
        case MarkTool::zoom: break;
    }
    if (clicked) {
        marks.from_x = mouse.x;
        marks.from_y = mouse.y;
    } else if (marks.from_x >= 0 && !ImGui::IsMouseDown(0)) {
        zoom_to(marks.zoom, x_mm(marks.from_x), z_mm(marks.from_y), x_mm(mouse.x), z_mm(mouse.y),
                area.w * scale * mm, area.h * scale * mm);
        marks.from_x = -1;
        marks.tool = MarkTool::none;
    }
    return true;
}

// While an educator places a target: the click sets it.
void place_new_target(bool flipped, const ImagePlace& place, Requests& requests) {
    if (!place.hovered || !ImGui::IsMouseClicked(0)) return;
    const ImGuiIO& io = ImGui::GetIO();
    const double mm = place.mm_per_screen_px;
    const double flip = flipped ? -1 : 1;
    requests.push_back(request::PlaceNewTarget{flip * (io.MousePos.x - place.origin_x) * mm,
                                               (io.MousePos.y - place.origin_y) * mm});
}

const char* shape_name(ProbeShape shape) {
    switch (shape) {
        case ProbeShape::linear: return "Linear";
        case ProbeShape::curvilinear: return "Curved";
        case ProbeShape::phased: return "Phased";
    }
    return "";
}

void show_top_bar(const SessionView& session,
                  Notices& notices,
                  Screen& screen,
                  Ui& ui,
                  const Box& bar,
                  Requests& requests) {
    const CaseState& loaded = session.loaded;
    const ScanState& scan = session.scan;
    const std::string title = loaded.texts().title;
    const std::string server = scan.servers.igtl ? session.serve : "";
    const TopBarRequest request =
        draw_top_bar(ui, bar,
                     {.case_name = loaded.name(),
                      .exercise = title,
                      .exam = scan.training.in_exam(),
                      .recording = scan.training.attempt != nullptr,
                      .replays = scan.replay.runs(),
                      .tracker = session.tracker,
                      .live = session.live,
                      .frame = loaded.frame(),
                      .trainee = session.progress.trainee,
                      .server = server,
                      .notice = notices.standing().empty() ? nullptr : &notices.standing().back()});
    if (request.dismiss_notice) notices.dismiss(notices.standing().size() - 1);
    if (request.show_cases) requests.push_back(request::ShowCases{"Cases"});
    if (request.show_exercises) screen.dialog = Dialog::exercises;
    if (request.show_tracker) screen.dialog = Dialog::tracker;
    if (request.show_help) screen.dialog = Dialog::help;
    if (request.show_settings) screen.dialog = Dialog::settings;
    if (request.sign_in) screen.dialog = Dialog::sign_in;
}

int attempt_number(const SessionView& session) {
    const Training& training = session.scan.training;
    int number = training.attempt || !training.score ? 1 : 0;
    for (const ProgressEntry& entry : session.progress.history)
        number += entry.exercise == session.loaded.exercise().name &&
                  entry.case_name == session.loaded.name();
    return std::max(number, 1);
}

void show_task(const SessionView& session,
               Screen& screen,
               Ui& ui,
               const Box& card,
               const Box& finish,
               bool shows_card,
               Requests& requests) {
    const CaseState& loaded = session.loaded;
    const ScanState& scan = session.scan;
    const Training& training = scan.training;
    const std::vector<Point3> centres = loaded.target_centres();
    const ExerciseTexts texts = loaded.texts();
    const TaskCardInput input{
        .exercise = loaded.exercise(),
        .texts = texts,
        .record = loaded.frame().record,
        .target_centres = centres,
        .targets_reached = training.targets_reached,
        .steps = training.steps_done,
        .attempt = training.attempt.get(),
        .attempt_number = attempt_number(session),
        .mouse = scan.tracker.mouse.get(),
        .guide = training.guide ? &*training.guide : nullptr,
        .exam = training.in_exam(),
        .replays = scan.replay.runs(),
        .expert = scan.replay.runs() && !scan.replay.recorded,
        .flipped = scan.console.controls.settings.flip_left_right,
        .live = session.live,
        .shows_targets = shows_targets(scan, loaded.exercise()),
        .hints_shown = training.hints_shown,
        .hint_step = training.hint_step,
        .hint_s = training.hint_s,
        .has_result = training.result.has_value(),
        .difficulty = attempt_difficulty(loaded.attempt_seed),
        .shows_finish = finish.empty(),
        .procedure = loaded.exercise().procedure.given() ? &loaded.frame().procedure : nullptr,
        .put_off = screen.put_off,
        .labels = loaded.open->bundle->labels};
    TaskCardRequest wanted;
    if (shows_card) wanted = draw_task_card(ui, card, input);
    if (!finish.empty() && draw_attempt_button(ui, finish, input, true))
        (input.replays ? wanted.end_replay : wanted.toggle_attempt) = true;
    if (wanted.next_hint) requests.push_back(request::NextHint{});
    if (wanted.toggle_attempt) requests.push_back(request::ToggleAttempt{});
    if (wanted.show_result) screen.page = Page::after;
    if (wanted.skip_guide) requests.push_back(request::SkipGuide{});
    if (wanted.end_replay) requests.push_back(request::EndReplay{});
    if (wanted.toggle_needle) requests.push_back(request::ToggleNeedle{});
    if (wanted.put_off) screen.put_off = *wanted.put_off;
    if (wanted.act) requests.push_back(request::PerformAct{*wanted.act});
}

const char* mode_words(DopplerMode mode) {
    switch (mode) {
        case DopplerMode::off: break;
        case DopplerMode::colour: return tr("Colour");
        case DopplerMode::power: return tr("Power");
        case DopplerMode::spectral: return "PW";
        case DopplerMode::m_mode: return "M";
    }
    return "B";
}

// Angle and place of the gate, and the rate that a machine with this colour box would have.
void add_doppler_words(const DopplerSettings& d, const DopplerFrame& frame, ImageViewInput& input) {
    if (d.mode == DopplerMode::off || frame.mode == DopplerMode::off) return;
    if (d.mode == DopplerMode::spectral)
        input.right_lines.push_back(text(tr("angle %.0f°"), d.angle_deg) +
                                    text("  %.1f mm", d.gate_mm));
    if (d.mode == DopplerMode::colour || d.mode == DopplerMode::power)
        input.right_lines.push_back(text(tr("%.0f pictures/s"), frame.colour.frame_hz));
    if (!frame.has_flow && d.mode != DopplerMode::m_mode)
        input.right_lines.push_back(tr("No flow in this case"));
}

void add_corner_words(const SessionView& session,
                      const ViewState& view,
                      ImageViewInput& input,
                      bool narrow) {
    const CaseState& loaded = session.loaded;
    const ImageSettings& image = session.scan.console.controls.settings;
    const Probe& probe = loaded.exercise().probe;
    const std::string depth =
        std::string(tr("Depth")) + text(" %.0f cm", loaded.engine.image.depth_mm / 10);
    const std::string gain =
        std::string(tr("Gain")) +
        (std::abs(image.gain_db) < 0.5 ? " 0 dB" : text(" %+.0f dB", image.gain_db));
    if (narrow) {
        input.left_lines = {depth};
        if (session.scan.servers.igtl)
            input.left_lines.push_back(std::string(tr("Serving")) + " " + session.serve);
        input.right_lines = {gain};
    } else {
        input.left_lines = {
            std::string(tr(shape_name(probe.shape))) + text("  %.1f MHz", probe.frequency_mhz),
            depth, std::string(tr("Focus")) + text(" %.1f cm", loaded.engine.image.focus_mm / 10)};
        input.right_lines = {mode_words(image.doppler.mode), gain,
                             std::string(tr("Range")) + text(" %.0f dB", image.dynamic_range_db)};
    }
    add_doppler_words(image.doppler, loaded.frame().doppler, input);
    if (view.tools.marks.tool == MarkTool::zoom) input.right_lines.push_back(tr("Drag a box"));
    if (view.tools.marks.tool == MarkTool::label)
        input.right_lines.push_back(tr("Click where the words go"));
    const PressReport& press = loaded.frame().record.press;
    if (press.pressed)
        input.right_lines.push_back(std::string(tr("Force")) + text(" %.1f N", press.force_n) +
                                    text("  %.0f kPa", press.pressure_kpa));
    if (view.tools.measuring) input.right_lines.push_back(tr("Click two points"));
    if (view.educator.new_target.placing)
        input.right_lines.push_back(tr("Click where the target is"));
}

// Names of what the frame shows, and of what was under the pointer in the picture before.
void add_names(const HoverNames& hover, ImageViewInput& input) {
    input.picked_name = hover.picked;
    for (const TissueName& name : hover.shown)
        input.names.push_back({name.column, name.row, name.words});
}

// Asks for the name of what lies under the pointer.
void pick_name(ViewState& view, const ImagePlace& place, Requests& requests) {
    const ImVec2 mouse = ImGui::GetIO().MousePos;
    view.hover.picked.clear();
    const bool busy = view.tools.measuring || view.educator.new_target.placing ||
                      ImGui::IsMouseDown(0) || ImGui::IsMouseDown(1) || ImGui::IsMouseDown(2);
    if (!place.hovered || busy) return;
    requests.push_back(
        request::NamePixel{static_cast<int>((mouse.x - place.x) / place.px_per_image_px),
                           static_cast<int>((mouse.y - place.y) / place.px_per_image_px)});
}

// The targets beside the picture shown.
std::vector<TargetMark> target_marks(const CaseState& loaded) {
    std::vector<TargetMark> marks;
    const Rigid probe_from = inverse(loaded.frame().record.tools.mannequin_from_probe);
    const std::vector<Point3> centres = loaded.target_centres();
    for (std::size_t i = 0; i < centres.size(); ++i) {
        const Target& target = loaded.exercise().targets[i];
        marks.push_back({probe_from * centres[i], target.radius_mm, tissue_words(target.name)});
    }
    return marks;
}

void show_image(const SessionView& session,
                ScanControls& controls,
                ViewState& view,
                Ui& ui,
                const Box& area,
                Requests& requests) {
    const CaseState& loaded = session.loaded;
    const TrackerInUse& tracker = session.scan.tracker;
    const PictureSize size = picture_size(area, ui.scale());
    if (!controls.frozen) requests.push_back(request::FitImage{size.width_px, size.height_px});
    const ImageTexture& texture = *view.display.texture;
    ImageViewInput input{loaded.frame(), texture.empty() ? nullptr : texture.id(),
                         loaded.exercise().probe, view.tools.measurements};
    input.flipped = controls.settings.flip_left_right;
    input.measuring = view.tools.measuring;
    input.placing = view.educator.new_target.placing;
    add_corner_words(session, view, input, area.h < 420);
    const Rigid probe_from_mannequin = inverse(loaded.frame().record.tools.mannequin_from_probe);
    if (session.scan.replay.runs()) {
        for (const Point3& p : session.scan.replay.best_way)
            input.way.push_back(probe_from_mannequin * p);
    }
    if (!session.live && !controls.frozen) {
        input.stopped = session.tracker.message.empty() ? tr("No reading from the tracker yet")
                                                        : tr_message(session.tracker.message);
        if (tracker.lost_since_s >= 0) input.stopped_s = session.now_s - tracker.lost_since_s;
    }
    if (controls.settings.doppler.mode != DopplerMode::off)
        input.doppler = &controls.settings.doppler;
    if (!view.display.strip->empty()) input.strip = view.display.strip->id();
    input.marks = &view.tools.marks;
    add_names(view.hover, input);
    const ImagePlace place = draw_image_view(ui, area, input);
    if (place.open_setup) view.screen.show_setup = true;
    if (place.use_mouse) requests.push_back(request::GoOnWithMouse{});
    // The last hint.
    if (session.scan.training.attempt && shows_targets(session.scan, loaded.exercise()) &&
        loaded.frame().record.tools.has_probe && input.stopped.empty()) {
        ui.clip(area);
        draw_target_marks(ui, place, target_marks(loaded), input.flipped);
        ui.unclip();
    }
    pick_name(view, place, requests);
    if (view.educator.new_target.placing) {
        place_new_target(input.flipped, place, requests);
        return;
    }
    if (handle_marks_mouse(view.tools.marks, view.screen, place, area, ui.scale())) return;
    if (handle_doppler_mouse(loaded, controls.settings, view.tools, place, ui.scale())) return;
    handle_picture_mouse(place, controls.settings.flip_left_right, view.tools.measuring,
                         view.tools.measurements, tracker.mouse.get());
}

void show_view3d(
    const SessionView& session, Display& display, Screen& screen, Ui& ui, const Box& card) {
    const CaseState& loaded = session.loaded;
    const ScanState& scan = session.scan;
    const std::vector<Point3> centres = loaded.target_centres();
    const bool replay = scan.replay.runs();
    const std::vector<Point3> none;
    const bool swap = draw_view3d_panel(ui, *loaded.view3d, display.small_view,
                                        {.frame = loaded.frame(),
                                         .texture = *display.texture,
                                         .target_centres = centres,
                                         .targets_reached = scan.training.targets_reached,
                                         .shows_targets = shows_targets(scan, loaded.exercise()),
                                         .exam = scan.training.in_exam(),
                                         .flipped = scan.console.controls.settings.flip_left_right,
                                         .now_s = session.now_s,
                                         .skin = *loaded.skin,
                                         .mouse = scan.tracker.mouse.get(),
                                         .path = replay ? scan.replay.tip_path : none,
                                         .best = replay ? scan.replay.best_way : none},
                                        card);
    // What is not live is not shown as good: grey under a veil.
    if (!session.live && !scan.console.controls.frozen)
        ui.fill(card, colour::rgba(0x10, 0x11, 0x12, 190), 8);
    if (swap) screen.swapped = !screen.swapped;
}

void show_console(const SessionView& session,
                  ScanControls& controls,
                  Screen& screen,
                  PictureTools& tools,
                  Ui& ui,
                  const Box& card,
                  Requests& requests) {
    const ConsoleRequest wanted = draw_console(ui, card, controls,
                                               {.image = session.loaded.engine.image,
                                                .probe = session.loaded.exercise().probe,
                                                .page = screen.console_page,
                                                .enabled = session.live || controls.frozen,
                                                .measuring = tools.measuring,
                                                .sound = session.settings.sound,
                                                .marks = tools.marks});
    if (wanted.depth_by_mm != 0) requests.push_back(request::ChangeDepth{wanted.depth_by_mm});
    if (wanted.focus_by_mm != 0) requests.push_back(request::ChangeFocus{wanted.focus_by_mm});
    if (wanted.preset) requests.push_back(request::ChoosePreset{wanted.preset});
    if (wanted.adjust_gain) adjust_gain(session.loaded.frame(), controls.settings);
    if (wanted.mode) requests.push_back(request::ChooseMode{*wanted.mode});
    if (wanted.aim) requests.push_back(request::AimDoppler{});
    if (wanted.toggle_sound) requests.push_back(request::ToggleSound{});
    if (wanted.clear) clear_marks(tools);
}

void show_cine(
    const SessionView& session, Console& console, Ui& ui, const Box& bar, Requests& requests) {
    const ScanFrame& frame = session.loaded.frame();
    const ScanState& scan = session.scan;
    const CineRequest wanted =
        draw_cine_bar(ui, bar, console.controls, console.cine,
                      {.kept = frame.cine_frames,
                       .age_s = frame.cine_age_s,
                       .enabled = session.live || console.controls.frozen,
                       .replay = scan.replay.runs() ? scan.tracker.paced.get() : nullptr});
    if (wanted.toggle_freeze) set_frozen(console, !console.controls.frozen);
    if (wanted.save_picture) requests.push_back(request::SavePicture{});
    if (wanted.save_clip) requests.push_back(request::SaveClip{});
}

// One column with tabs: the chosen tab, and the button that starts and ends an attempt.
void show_tabs(const SessionView& session,
               Notices& notices,
               Console& console,
               ViewState& view,
               Ui& ui,
               const ScanLayout& layout,
               Requests& requests) {
    Screen& screen = view.screen;
    constexpr const char* kTabs[] = {"Task", "Image", "3-D"};
    Box tabs = layout.tabs;
    if (layout.top_bar.empty()) {
        ButtonStyle style;
        style.icon = Icon::menu;
        style.tip = "Cases, help, settings";
        if (ui.button("menu", tabs.take_right(44, 4), "", style)) screen.dialog = Dialog::settings;
    }
    for (int i = 0; i < 3; ++i) {
        ButtonStyle style;
        style.chosen = screen.tab == i;
        if (ui.button(kTabs[i], tabs.column(i, 3, 4), tr(kTabs[i]), style)) screen.tab = i;
    }
    Box card = layout.card;
    if (layout.top_bar.empty() && !notices.standing().empty()) {
        const Box box = card.take_bottom(72, 8);
        if (draw_notice(ui, box, notices.standing().back()))
            notices.dismiss(notices.standing().size() - 1);
    }
    show_task(session, screen, ui, card, layout.finish, screen.tab == 0, requests);
    if (screen.tab == 1)
        show_console(session, console.controls, screen, view.tools, ui, card, requests);
    if (screen.tab == 2) show_view3d(session, view.display, screen, ui, card);
}

}  // namespace

void draw_scan_page(const SessionView& session,
                    Notices& notices,
                    Console& console,
                    ViewState& view,
                    Ui& ui,
                    Requests& requests) {
    Screen& screen = view.screen;
    const Box window = ui.window();
    const ScanLayout layout = scan_layout(window.w, window.h, session.settings.show_3d);
    if (!layout.top_bar.empty())
        show_top_bar(session, notices, screen, ui, layout.top_bar, requests);
    const bool swapped = screen.swapped && !layout.view3d.empty();
    const Box& picture = swapped ? layout.view3d : layout.picture;
    if (swapped) {
        show_view3d(session, view.display, screen, ui, layout.picture);
    } else if (!layout.view3d.empty()) {
        show_view3d(session, view.display, screen, ui, layout.view3d);
    }
    show_image(session, console.controls, view, ui, picture, requests);
    show_cine(session, console, ui, layout.cine, requests);
    if (layout.tabbed()) {
        show_tabs(session, notices, console, view, ui, layout, requests);
    } else {
        show_task(session, screen, ui, layout.task, {}, true, requests);
        show_console(session, console.controls, screen, view.tools, ui, layout.console, requests);
    }
}

}  // namespace sonocase::runtime::inline player_ui
