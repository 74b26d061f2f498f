// SPDX-License-Identifier: Apache-2.0

// The scanning page: puts the panels where the layout says, and takes the steps that they ask for.
#include <imgui.h>

#include <algorithm>
#include <cmath>

#include "formats/attempt/difficulty.h"
#include "runtime/player/app/attempt_steps.h"
#include "runtime/player/app/case_steps.h"
#include "runtime/player/app/progress_steps.h"
#include "runtime/player/app/replay_path.h"
#include "runtime/player/app/saved_pictures.h"
#include "runtime/player/app/shown_frame.h"
#include "runtime/player/app/sound_steps.h"
#include "runtime/player/app/tracker_steps.h"
#include "runtime/player/ui/layout/scan_layout.h"
#include "runtime/player/ui/pages/pages.h"
#include "runtime/player/ui/pages/picture_mouse.h"
#include "runtime/player/ui/panels/panels.h"
#include "runtime/player/ui/parts/panel_parts.h"
#include "runtime/player/words/said.h"
#include "runtime/player/words/words.h"

namespace sonocase::runtime {
namespace {

const char* shape_name(ProbeShape shape) {
    switch (shape) {
        case ProbeShape::linear: return "Linear";
        case ProbeShape::curvilinear: return "Curved";
        case ProbeShape::phased: return "Phased";
    }
    return "";
}

std::string title_of(const Exercise& exercise) {
    return exercise.title.empty() ? exercise.name : exercise.title;
}

void show_top_bar(App& app, Ui& ui, const Box& bar, const TrackerHealth& tracker) {
    const CaseState& loaded = app.loaded;
    Notices& notices = app.view.notices;
    const std::string title = title_of(loaded.exercise());
    const TopBarRequest request = draw_top_bar(
        ui, bar,
        {loaded.open->bundle->manifest.case_name, title,
         app.scan.exam && app.scan.attempt != nullptr, app.scan.attempt != nullptr,
         replays(app.scan), tracker, tracker_is_live(app, tracker), loaded.frame(),
         app.player.trainee, app.scan.server ? app.player.arguments.serve : std::string(),
         notices.standing().empty() ? nullptr : &notices.standing().back()});
    ViewState& view = app.view;
    if (request.dismiss_notice) notices.dismiss(notices.standing().size() - 1);
    if (request.show_cases && may_leave_attempt(app, "Cases")) {
        finish_attempt(app);
        show_bundles(app.player, view);
    }
    if (request.show_exercises) view.dialog = Dialog::exercises;
    if (request.show_tracker) view.dialog = Dialog::tracker;
    if (request.show_help) view.dialog = Dialog::help;
    if (request.show_settings) view.dialog = Dialog::settings;
    if (request.sign_in) view.dialog = Dialog::sign_in;
}

int attempt_number(const App& app) {
    int number = app.scan.attempt || !app.scan.score ? 1 : 0;
    for (const ProgressEntry& entry : app.player.history)
        number += entry.exercise == app.loaded.exercise().name &&
                  entry.case_name == app.loaded.open->bundle->manifest.case_name;
    return std::max(number, 1);
}

void show_task(App& app,
               Ui& ui,
               const Box& card,
               const Box& finish,
               const TrackerHealth& tracker,
               bool shows_card) {
    const CaseState& loaded = app.loaded;
    const std::vector<Point3> centres = loaded.target_centres();
    const TaskCardInput input{loaded.exercise(),
                              loaded.frame().record,
                              centres,
                              app.scan.targets_reached,
                              app.scan.attempt.get(),
                              attempt_number(app),
                              app.scan.tracker.mouse.get(),
                              app.scan.guide ? &*app.scan.guide : nullptr,
                              app.scan.exam && app.scan.attempt,
                              replays(app.scan),
                              tracker_is_live(app, tracker),
                              shows_targets(app.scan, loaded.exercise()),
                              app.scan.hints_shown,
                              app.scan.result.has_value(),
                              attempt_difficulty(loaded.attempt_seed),
                              finish.empty()};
    TaskCardRequest request;
    if (shows_card) request = draw_task_card(ui, card, input);
    if (!finish.empty() && draw_attempt_button(ui, finish, input))
        (input.replays ? request.end_replay : request.toggle_attempt) = true;
    if (request.next_hint) show_next_hint(app);
    if (request.toggle_attempt) toggle_attempt(app);
    if (request.show_result) app.view.page = Page::after;
    if (request.skip_guide) app.scan.guide->skip();
    if (request.end_replay) {
        end_replay(app);
        app.view.page = Page::after;
    }
    if (request.toggle_needle)
        toggle_needle(app.scan.tracker, loaded.exercise().probe, true, app.view.notices);
}

const char* mode_words(const App& app) {
    switch (app.scan.controls.settings.doppler.mode) {
        case DopplerMode::off: break;
        case DopplerMode::colour: return tr("Colour");
        case DopplerMode::power: return tr("Power");
        case DopplerMode::spectral: return "PW";
        case DopplerMode::m_mode: return "M";
    }
    return "B";
}

// Scale and filter, and the rate that a machine with this box would have.
void add_doppler_words(const App& app, ImageViewInput& input) {
    const DopplerSettings& d = app.scan.controls.settings.doppler;
    const DopplerFrame& frame = app.loaded.frame().doppler;
    if (d.mode == DopplerMode::off || frame.mode == DopplerMode::off) return;
    if (d.mode == DopplerMode::spectral)
        input.right_lines.push_back(text(tr("angle %.0f°"), d.angle_deg) +
                                    text("  %.1f mm", d.gate_mm));
    if (d.mode == DopplerMode::colour || d.mode == DopplerMode::power)
        input.right_lines.push_back(text(tr("%.0f pictures/s"), frame.colour.frame_hz));
    if (!frame.has_flow && d.mode != DopplerMode::m_mode)
        input.right_lines.push_back(tr("No flow in this case"));
}

void add_corner_words(const App& app, ImageViewInput& input, bool narrow) {
    const CaseState& loaded = app.loaded;
    const ImageSettings& image = app.scan.controls.settings;
    const Probe& probe = loaded.exercise().probe;
    const std::string depth =
        std::string(tr("Depth")) + text(" %.0f cm", loaded.image.depth_mm / 10);
    const std::string gain =
        std::string(tr("Gain")) +
        (std::abs(image.gain_db) < 0.5 ? " 0 dB" : text(" %+.0f dB", image.gain_db));
    if (narrow) {
        input.left_lines = {depth};
        if (app.scan.server)
            input.left_lines.push_back(std::string(tr("Serving")) + " " +
                                       app.player.arguments.serve);
        input.right_lines = {gain};
    } else {
        input.left_lines = {
            std::string(tr(shape_name(probe.shape))) + text("  %.1f MHz", probe.frequency_mhz),
            depth, std::string(tr("Focus")) + text(" %.1f cm", loaded.image.focus_mm / 10)};
        input.right_lines = {mode_words(app), gain,
                             std::string(tr("Range")) + text(" %.0f dB", image.dynamic_range_db)};
    }
    add_doppler_words(app, input);
    if (app.view.marks_on_picture.tool == MarkTool::zoom)
        input.right_lines.push_back(tr("Drag a box"));
    if (app.view.marks_on_picture.tool == MarkTool::label)
        input.right_lines.push_back(tr("Click where the words go"));
    const PressReport& press = loaded.frame().record.press;
    if (press.pressed)
        input.right_lines.push_back(std::string(tr("Force")) + text(" %.1f N", press.force_n) +
                                    text("  %.0f kPa", press.pressure_kpa));
    if (app.view.measuring) input.right_lines.push_back(tr("Click two points"));
    if (app.view.new_target.placing) input.right_lines.push_back(tr("Click where the target is"));
}

// Names of what the frame shows: of the last picture, where the pointer was.
void look_at(const App& app, ImageViewInput& input) {
    input.name_there = app.view.look.there;
    for (const TissueName& name : app.view.look.shown)
        input.names.push_back({name.column, name.row, name.words});
}

void point_at(App& app, const ImagePlace& place) {
    const ImVec2 mouse = ImGui::GetIO().MousePos;
    std::string& there = app.view.look.there;
    there.clear();
    const bool busy = app.view.measuring || app.view.new_target.placing || ImGui::IsMouseDown(0) ||
                      ImGui::IsMouseDown(1) || ImGui::IsMouseDown(2);
    if (!place.hovered || busy) return;
    there = name_of_pixel(app, static_cast<int>((mouse.x - place.x) / place.px_per_image_px),
                          static_cast<int>((mouse.y - place.y) / place.px_per_image_px));
}

void show_image(App& app, Ui& ui, const Box& area, const TrackerHealth& tracker) {
    ScanControls& controls = app.scan.controls;
    const CaseState& loaded = app.loaded;
    const PictureSize size = picture_size(area, ui.scale());
    if (!controls.frozen) fit_image(app, size.width_px, size.height_px);
    const ImageTexture& texture = *app.view.texture;
    ImageViewInput input{loaded.frame(), texture.empty() ? nullptr : texture.id(),
                         loaded.exercise().probe, app.view.measurements};
    input.flipped = controls.settings.flip_left_right;
    input.measuring = app.view.measuring;
    input.placing = app.view.new_target.placing;
    add_corner_words(app, input, area.h < 420);
    const Rigid probe_from_mannequin = inverse(loaded.frame().record.tools.mannequin_from_probe);
    if (replays(app.scan)) {
        for (const Point3& p : app.scan.best_way) input.way.push_back(probe_from_mannequin * p);
    }
    if (!tracker_is_live(app, tracker) && !controls.frozen) {
        input.stopped = tracker.message.empty() ? tr("No reading from the tracker yet")
                                                : tr_said(tracker.message);
        if (app.scan.tracker.lost_since_s >= 0)
            input.stopped_s = app.player.now_s - app.scan.tracker.lost_since_s;
    }
    if (controls.settings.doppler.mode != DopplerMode::off)
        input.doppler = &controls.settings.doppler;
    if (!app.view.strip->empty()) input.strip = app.view.strip->id();
    input.marks = &app.view.marks_on_picture;
    look_at(app, input);
    const ImagePlace place = draw_image_view(ui, area, input);
    point_at(app, place);
    if (app.view.new_target.placing) {
        place_new_target(app, place);
        return;
    }
    if (handle_marks_mouse(app, place, area, ui.scale())) return;
    if (handle_doppler_mouse(app, place, ui.scale())) return;
    handle_picture_mouse(place, controls.settings.flip_left_right, app.view.measuring,
                         app.view.measurements, app.scan.tracker.mouse.get());
}

void show_view3d(App& app, Ui& ui, const Box& card) {
    const CaseState& loaded = app.loaded;
    const std::vector<Point3> centres = loaded.target_centres();
    const bool replay = replays(app.scan);
    const std::vector<Point3> none;
    const bool swap = draw_view3d_panel(
        ui, app.view.small_view,
        {loaded.frame(), *app.view.texture, centres, app.scan.targets_reached,
         shows_targets(app.scan, loaded.exercise()), app.scan.exam && app.scan.attempt,
         app.scan.controls.settings.flip_left_right, app.player.now_s, *loaded.skin,
         app.scan.tracker.mouse.get(), replay ? app.scan.tip_path : none,
         replay ? app.scan.best_way : none},
        card);
    if (swap) app.view.swapped = !app.view.swapped;
}

void show_console(App& app, Ui& ui, const Box& card, const TrackerHealth& tracker) {
    const ConsoleRequest request =
        draw_console(ui, card, app.scan.controls,
                     {app.loaded.image, app.loaded.exercise().probe, app.view.console_page,
                      tracker_is_live(app, tracker) || app.scan.controls.frozen, app.view.measuring,
                      app.player.settings.sound, app.view.marks_on_picture});
    if (request.depth_by_mm != 0) change_depth(app, request.depth_by_mm);
    if (request.focus_by_mm != 0) change_focus(app, request.focus_by_mm);
    if (request.preset) choose_preset(app, *request.preset);
    if (request.adjust_gain) adjust_gain(app);
    if (request.mode) choose_mode(app, *request.mode);
    if (request.aim) aim_doppler(app);
    if (request.toggle_sound) toggle_sound(app);
    if (request.clear) clear_marks(app.view);
}

void show_cine(App& app, Ui& ui, const Box& bar, const TrackerHealth& tracker) {
    const ScanFrame& frame = app.loaded.frame();
    const CineRequest request =
        draw_cine_bar(ui, bar, app.scan.controls, app.scan.cine,
                      {frame.cine_frames, frame.cine_age_s,
                       tracker_is_live(app, tracker) || app.scan.controls.frozen,
                       replays(app.scan) ? app.scan.tracker.paced.get() : nullptr});
    if (request.toggle_freeze) set_frozen(app.scan, !app.scan.controls.frozen);
    if (request.save_picture) save_picture(app);
    if (request.save_clip) start_clip(app);
}

// The chosen tab of the one column that there is.
void show_tabs(App& app, Ui& ui, const ScanLayout& layout, const TrackerHealth& tracker) {
    constexpr const char* kTabs[] = {"Task", "Image", "3-D"};
    Box tabs = layout.tabs;
    if (layout.top_bar.empty()) {
        Look look;
        look.icon = Icon::menu;
        look.tip = "Cases, help, settings";
        if (ui.button("menu", tabs.take_right(44, 4), "", look)) app.view.dialog = Dialog::settings;
    }
    for (int i = 0; i < 3; ++i) {
        Look look;
        look.chosen = app.view.tab == i;
        if (ui.button(kTabs[i], tabs.column(i, 3, 4), tr(kTabs[i]), look)) app.view.tab = i;
    }
    Box card = layout.card;
    Notices& notices = app.view.notices;
    if (layout.top_bar.empty() && !notices.standing().empty()) {
        const Box box = card.take_bottom(72, 8);
        if (draw_notice(ui, box, notices.standing().back()))
            notices.dismiss(notices.standing().size() - 1);
    }
    show_task(app, ui, card, layout.finish, tracker, app.view.tab == 0);
    if (app.view.tab == 1) show_console(app, ui, card, tracker);
    if (app.view.tab == 2) show_view3d(app, ui, card);
}

void observe_guide(App& app) {
    if (!app.scan.guide) return;
    const FrameRecord& record = app.loaded.frame().record;
    app.scan.guide->observe({record.tools.has_probe, record.tools.mannequin_from_probe,
                             app.scan.controls.frozen, record.tools.has_needle,
                             record.needle.depth_mm});
}

}  // namespace

void draw_scan_page(App& app, Ui& ui, const TrackerHealth& tracker) {
    mark_targets_reached(app.loaded.exercise(), app.loaded.frame().record,
                         app.loaded.target_centres(), app.scan.targets_reached);
    observe_guide(app);
    follow_replay(app);
    const Box window = ui.window();
    const ScanLayout layout = scan_layout(window.w, window.h, app.player.settings.show_3d);
    if (!layout.top_bar.empty()) show_top_bar(app, ui, layout.top_bar, tracker);
    const bool swapped = app.view.swapped && !layout.view3d.empty();
    const Box& picture = swapped ? layout.view3d : layout.picture;
    if (swapped) {
        show_view3d(app, ui, layout.picture);
    } else if (!layout.view3d.empty()) {
        show_view3d(app, ui, layout.view3d);
    }
    show_image(app, ui, picture, tracker);
    show_cine(app, ui, layout.cine, tracker);
    if (layout.tabbed()) {
        show_tabs(app, ui, layout, tracker);
    } else {
        show_task(app, ui, layout.task, {}, tracker, true);
        show_console(app, ui, layout.console, tracker);
    }
}

}  // namespace sonocase::runtime
