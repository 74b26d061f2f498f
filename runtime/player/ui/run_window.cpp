// SPDX-License-Identifier: Apache-2.0

#include "runtime/player/ui/run_window.h"

#include <algorithm>
#include <csignal>
#include <cstdio>

#include "runtime/display/input_script.h"
#include "runtime/player/app/attempt_steps.h"
#include "runtime/player/app/case_steps.h"
#include "runtime/player/app/picture_pace.h"
#include "runtime/player/app/saved_pictures.h"
#include "runtime/player/app/settings.h"
#include "runtime/player/app/shown_frame.h"
#include "runtime/player/app/sound_steps.h"
#include "runtime/player/app/tracker_steps.h"
#include "runtime/player/session/clock.h"
#include "runtime/player/session/frame_stats.h"
#include "runtime/player/session/png_file.h"
#include "runtime/player/ui/image_view.h"
#include "runtime/player/ui/instructor_window.h"
#include "runtime/player/ui/pages.h"
#include "runtime/player/ui/parts/layout.h"
#include "runtime/player/ui/player_window.h"
#include "runtime/player/words/words.h"

namespace sonocase::runtime::inline player_ui {
namespace {

// Set by SIGTERM, SIGINT and SIGHUP: a session that ends, or a system that shuts down, ends the
// program as the user does, with settings and recordings kept.
volatile std::sig_atomic_t g_asked_to_end = 0;
void ask_to_end(int) {
    g_asked_to_end = 1;
}

void apply_settings(const Settings& settings, ScanControls& controls) {
    controls.settings.dynamic_range_db = settings.dynamic_range_db;
}

void report(const Status& done) {
    if (!done) std::fprintf(stderr, "sonoplay: %s\n", done.error().message().c_str());
}

Status save_screenshot(const Window& window, const std::string& path) {
    const Window::Capture& picture = window.captured();
    if (picture.pixels.empty()) return Done{};
    return write_png(path, picture.width_px, picture.height_px, 3, picture.pixels);
}

// Calipers belong to the exercise that they were set in.
void keep_measurements(const CaseState& loaded, PictureTools& tools) {
    if (tools.exercise == loaded.exercise_number) return;
    tools.exercise = loaded.exercise_number;
    tools.measurements.clear();
}

// Pages with a picture; the set-up has one also where it opens over an attempt's result.
bool shows_picture(const Screen& screen) {
    return screen.page == Page::scan || (screen.page == Page::after && screen.show_setup);
}

}  // namespace

// When pictures begin, and how fast they follow each other.
class PictureClock {
  public:
    // Waits until the next picture is due, or input comes and it is nearly due. 60 pictures per
    // second; a display that paces itself through the swap is not slowed further.
    // longest_s: from one picture to the next without input.
    void wait(Window& window, double longest_s) {
        due_s_ = last_s_ + kPictureTime;
        // Input ends the longer wait; an end of the program asked for by a signal is seen within
        // it.
        if (longest_s > kPictureTime) wait_for_input(window, last_s_ + longest_s);
        do {
            window.wait_events(std::max(0.0, due_s_ - steady_seconds()));
        } while (steady_seconds() < due_s_ - 5e-4 && !window.should_close());
        now_s_ = steady_seconds();
        seconds_ = std::min(now_s_ - last_s_, 0.1);
        last_s_ = std::max(due_s_, now_s_ - kPictureTime);
        between_s_ = now_s_ - last_shown_s_;
        if (between_s_ > 0) rate_ += 0.08 * (1 / between_s_ - rate_);
        last_shown_s_ = now_s_;
    }
    double now_s() const { return now_s_; }          // start of this picture, steady_seconds()
    double input_s() const { return input_s_; }      // when input last ended a wait
    double seconds() const { return seconds_; }      // that input acts for, at most 0.1
    double between_s() const { return between_s_; }  // since the start of the picture before
    double rate() const { return rate_; }            // per second, smoothed

  private:
    // Ends with input, at `until_s`, or soon after the program was asked to end.
    void wait_for_input(Window& window, double until_s) {
        constexpr double kSignalSeen = 0.5;  // s; a signal is seen within it
        constexpr double kEarly = 2e-3;
        for (double now = steady_seconds(); now < until_s && !g_asked_to_end;) {
            const double wait_s = std::min(until_s - now, kSignalSeen);
            window.wait_events(wait_s);
            const double before = now;
            now = steady_seconds();
            if (now - before < wait_s - kEarly) {
                input_s_ = now;
                return;
            }
        }
    }

    double last_s_ = steady_seconds(), input_s_ = last_s_, last_shown_s_ = last_s_, due_s_ = 0,
           now_s_ = 0;
    double seconds_ = 0, between_s_ = 0, rate_ = 0;
};

PlayerWindow::PlayerWindow(const PlayerArguments& arguments, double start_s) : start_s_(start_s) {
    player_.arguments = arguments;
    player_.clock_start_s = steady_seconds();
}

Status PlayerWindow::set_up() {
    PlayerState& player = player_;
    const PlayerArguments& arguments = player.arguments;
    if (!config_folder().empty()) player.settings_file = config_folder() + "/player.json";
    std::string warning;
    player.settings = load_settings(player.settings_file, warning);
    if (!arguments.script.empty()) {
        SONOCASE_TRY(InputScript script, InputScript::load(arguments.script));
        script_ = std::move(script);
        script_.set_finder([this](const std::string& name, float& x, float& y) {
            const DrawnBox* found = nullptr;  // the one on top
            for (const DrawnBox& drawn : ui_.drawn()) {
                if (drawn.kind == DrawnBox::Kind::control && drawn.name == name) found = &drawn;
            }
            if (!found) return false;
            x = ui_.scale() * (found->box.x + 0.5f * found->box.w);
            y = ui_.scale() * (found->box.y + 0.5f * found->box.h);
            return true;
        });
    }
    const Status calibrated = load_initial_calibrations(player, loaded_.set_up);
    if (!calibrated) return calibrated;
    apply_settings(player.settings, scan_.console.controls);
    use_language(player.settings.language.empty() ? locale_language() : player.settings.language);
    if (Status opened = open_window(); !opened) return opened;
    start_scanning();
    if (!warning.empty()) player_.notices.warning(warning);
    const std::string kept_trainee = player.settings.trainee;
    sign_in(player, arguments.trainee.empty() ? kept_trainee : arguments.trainee);
    player.settings.trainee = kept_trainee;  // that of the command line is for this run
    show_bundles();
    if (arguments.bundle.empty()) return Done{};
    requests_.push_back(
        request::OpenCase{.path = arguments.bundle, .exercise = arguments.exercise});
    carry_out_requests();
    if (view_.screen.page == Page::scan && !arguments.record.empty())
        start_attempt(player_, loaded_, scan_, arguments.record);
    return Done{};
}

Status PlayerWindow::open_window() {
    const PlayerArguments& arguments = player_.arguments;
    const Settings& settings = player_.settings;
    view_.display.instructor.wanted = arguments.instructor;
    WindowOptions options;
    options.width_px = arguments.width_px > 0 ? arguments.width_px : settings.window_width_px;
    options.height_px = arguments.height_px > 0 ? arguments.height_px : settings.window_height_px;
    options.ui_scale = arguments.ui_scale > 0 ? arguments.ui_scale : settings.ui_scale;
    SONOCASE_TRY(std::unique_ptr<Window> window, Window::open(options));
    view_.display.window = std::move(window);
    view_.display.window->set_fitting_scale(effective_scale);
    view_.display.texture = std::make_unique<ImageTexture>();
    view_.display.strip = std::make_unique<ImageTexture>();
    loaded_.view3d = std::make_unique<View3d>();
    // The first engine already makes pictures of the size that they are shown in.
    const Window::Size size = view_.display.window->size();
    const float scale =
        effective_scale(size.width_px, size.height_px, view_.display.window->asked_scale());
    const ScanLayout layout = scan_layout(static_cast<float>(size.width_px) / scale,
                                          static_cast<float>(size.height_px) / scale);
    const PictureSize picture = picture_size(layout.picture, scale);
    loaded_.engine.image.width_px = picture.width_px;
    loaded_.engine.image.height_px = picture.height_px;
    return Done{};
}

void PlayerWindow::start_scanning() {
    const PlayerArguments& arguments = player_.arguments;
    const double clock_start_s = player_.clock_start_s;
    CaseState& loaded = loaded_;
    loaded.scan = std::make_unique<ScanThread>(session_clock(clock_start_s));
    loaded.scan->set_program_start_s(start_s_ - clock_start_s);
    loaded.scan->set_calibrations(loaded.set_up.calibrations);
    scan_.tracker.spec = arguments.tracker.empty() ? "mouse" : arguments.tracker;
    const auto keep = [&](auto server, auto& to) {
        if (server) {
            to = std::move(*server);
        } else {
            player_.notices.error(server.error().message());
        }
    };
    if (!arguments.serve.empty()) keep(IgtlServer::start(arguments.serve), scan_.servers.igtl);
    if (!arguments.serve_poses.empty())
        keep(PoseServer::start(arguments.serve_poses), scan_.servers.poses);
    if (scan_.servers.poses) {
        std::printf("poses for pages: %s\n", scan_.servers.poses->url().c_str());
        std::fflush(stdout);
    }
    observe_frames(nullptr, scan_.servers, *loaded.scan);
}

// Pages without a picture stand still, and so does a frozen picture.
Stillness PlayerWindow::stillness(const PictureClock& clock) const {
    constexpr double kFollows = 0.3;  // s until what an input asked for is rendered
    const bool frozen =
        scan_.console.controls.frozen && loaded_.frame().frozen && !scan_.console.cine.playing &&
        !scan_.console.clip && !scan_.training.attempt && scan_.tracker.mouse && shown_ > 0 &&
        shown_frame_ == loaded_.frame().number && steady_seconds() - clock.input_s() > kFollows;
    Stillness now;
    now.scanning = (shows_picture(view_.screen) && !frozen) || script_.active() ||
                   player_.arguments.frames > 0;
    now.key_held = view_.display.window->key_held();
    now.loading = (view_.chooser.cards && view_.chooser.cards->busy()) || loaded_.view3d->busy();
    now.notice = !player_.notices.standing().empty();
    now.typing = view_.display.window->typing();
    now.input_s_ago = steady_seconds() - clock.input_s();
    return now;
}

void PlayerWindow::show_pictures() {
    PictureClock clock;
    while (!view_.display.window->should_close()) {
        clock.wait(*view_.display.window, longest_wait_s(stillness(clock)));
        if (g_asked_to_end) view_.display.window->request_close();
        player_.now_s = clock.now_s() - player_.clock_start_s;
        show_picture(clock);
    }
}

bool PlayerWindow::all_shown() {
    if (view_.chooser.cards && view_.chooser.cards->busy()) return false;
    if (!loaded_.open) return true;
    if (!awaited_) awaited_ = loaded_.scan->controls_set();
    if (loaded_.scan->controls_shown() < *awaited_) return false;
    awaited_.reset();
    return true;
}

void PlayerWindow::show_picture(const PictureClock& clock) {
    const PlayerArguments& arguments = player_.arguments;
    Notices& notices = player_.notices;
    ViewState& view = view_;
    Display& display = view.display;
    CaseState& loaded = loaded_;
    Console& console = scan_.console;
    Window& window = *display.window;
    const double now_s = player_.now_s;
    notices.set_now_s(now_s);
    check_bundle(loaded, notices);

    std::string shot, instructor_shot;
    bool quit = false;
    InjectedInput input;
    const bool scripted = script_.active();
    input.active = scripted;
    // A script waits for what is made beside it, so that its pictures show the same on any machine.
    if (scripted) {
        const bool ready = !loaded.view3d->busy() && (!script_.saves_next() || all_shown());
        input = script_.next(now_s, ready, shot, quit);
        if (script_.of_instructor()) instructor_shot.swap(shot);
    }
    const bool pictured = !shot.empty() && !script_.boxes_alone();
    display.small_view.saved = pictured;
    window.begin_frame(input);
    const bool fresh = loaded.scan->refresh();
    if (fresh || view.hover.outlines != was_outlined_)
        show_frame(notices, loaded, display, view.hover, may_name_tissue(scan_));
    was_outlined_ = view.hover.outlines;
    shown_frame_ = loaded.frame().number;
    ui_.begin(window.scale(), now_s);
    if (const std::string dropped = window.dropped_file(); !dropped.empty())
        requests_.push_back(request::OpenCase{.path = dropped});
    carry_out_requests();
    TrackerHealth tracker = loaded.scan->tracker_health();
    // A key that a script holds moves as far on a slow machine as on a fast one.
    handle_keys(session(tracker), player_.settings, console, view, ui_,
                scripted ? kPictureTime : clock.seconds(), requests_);
    carry_out_requests();
    advance_clip(notices, loaded, console);
    // Calipers belong to the picture that they were set on.
    if (was_frozen_ && !console.controls.frozen) clear_marks(view.tools);
    was_frozen_ = console.controls.frozen;
    advance_cine(console, loaded.frame().cine_frames, now_s);
    tracker = loaded.scan->tracker_health();
    check_device(scan_.tracker, tracker, loaded, notices);
    note_readings(scan_.tracker, loaded, loaded.frame().frozen, now_s);
    keep_measurements(loaded, view.tools);
    draw_page(tracker);
    carry_out_requests();
    follow_sounds(player_, loaded, scan_);
    feed_mouse(scan_.tracker, steady_seconds() - player_.clock_start_s);
    console.controls.resting =
        view.screen.page != Page::scan && !scan_.training.attempt && !scan_.servers.igtl;
    console.controls.assignment = sensors_in_use(player_, scan_.tracker);
    if (loaded.open) loaded.scan->set_controls(console.controls);

    ++shown_;
    if (arguments.frames > 0 && shown_ >= arguments.frames) quit = true;
    const bool last = quit || window.should_close();
    const double drawn_s = steady_seconds();
    const bool saved = pictured || (last && !arguments.screenshot.empty());
    if (script_.only_shots() && !saved) {
        window.end_frame_unseen();
    } else {
        window.end_frame(saved);
    }
    if (shown_ > 1) {
        stats_.add(clock.between_s(), 1e3 * (drawn_s - clock.now_s()),
                   1e3 * (steady_seconds() - drawn_s));
    }
    if (!shot.empty()) {
        Status written = pictured ? save_screenshot(window, shot) : Status(Done{});
        if (written) written = write_boxes(ui_, shot);
        if (!written) notices.error(written.error().message());
    }
    if (const Status shown = follow_instructor_window(session(tracker), notices, loaded, view,
                                                      instructor_ui_, instructor_shot);
        !shown)
        notices.error(shown.error().message());
    if (quit) window.request_close();
}

void PlayerWindow::keep_settings() {
    const ScanControls& controls = scan_.console.controls;
    Settings& s = player_.settings;
    s.dynamic_range_db = controls.settings.dynamic_range_db;
    if (player_.arguments.tracker.empty()) s.tracker = scan_.tracker.spec;
    if (!player_.settings_file.empty()) report(save_settings(s, player_.settings_file));
}

void PlayerWindow::finish() {
    const PlayerArguments& arguments = player_.arguments;
    if (!arguments.screenshot.empty())
        report(save_screenshot(*view_.display.window, arguments.screenshot));
    finish_attempt(player_, loaded_, scan_);
    if (!arguments.stats.empty()) {
        const bool scored = scan_.training.score && loaded_.open;
        const std::string score =
            scored ? score_json(*scan_.training.score, loaded_.exercise()) : "";
        report(write_text_output(arguments.stats, loaded_.scan->stats_json(score, stats_.json())));
    }
    keep_settings();
    close_bundle(player_, loaded_, scan_);
    view_.display.instructor.window.reset();
    loaded_.scan.reset();
}

Status run_window(const PlayerArguments& arguments, double start_s) {
    PlayerWindow run(arguments, start_s);
    if (Status done = run.set_up(); !done) return done;
    for (const int signal : {SIGTERM, SIGINT, SIGHUP}) std::signal(signal, ask_to_end);
    run.show_pictures();
    run.finish();
    return Done{};
}

}  // namespace sonocase::runtime::inline player_ui
