// SPDX-License-Identifier: Apache-2.0

#include "runtime/player/ui/run_window.h"

#include <algorithm>
#include <csignal>
#include <cstdio>

#include "runtime/display/input_script.h"
#include "runtime/player/app/attempt_steps.h"
#include "runtime/player/app/case_steps.h"
#include "runtime/player/app/kept/user_folders.h"
#include "runtime/player/app/progress_steps.h"
#include "runtime/player/app/saved_pictures.h"
#include "runtime/player/app/scan/picture_pace.h"
#include "runtime/player/app/shown_frame.h"
#include "runtime/player/app/sound_steps.h"
#include "runtime/player/app/tracker_steps.h"
#include "runtime/player/session/clock.h"
#include "runtime/player/session/pictures/png_file.h"
#include "runtime/player/session/text_output.h"
#include "runtime/player/ui/box_file.h"
#include "runtime/player/ui/instructor_window.h"
#include "runtime/player/ui/layout/scan_layout.h"
#include "runtime/player/ui/pages/pages.h"
#include "runtime/player/ui/picture/image_view.h"
#include "runtime/player/words/words.h"

namespace sonocase::runtime {
namespace {

// Set by SIGTERM, SIGINT and SIGHUP: a session that ends, or a system that shuts down, ends the
// program as the user does, with settings and recordings kept.
volatile std::sig_atomic_t g_asked_to_end = 0;
void ask_to_end(int) {
    g_asked_to_end = 1;
}

void apply_settings(const Settings& settings, ScanControls& controls) {
    controls.settings.gain_db = settings.gain_db;
    controls.settings.dynamic_range_db = settings.dynamic_range_db;
    for (std::size_t i = 0; i < 8; ++i) controls.settings.tgc_db[i] = settings.tgc_db[i];
    controls.assignment = {settings.probe_sensor, settings.needle_sensor};
}

void report(const Status& done) {
    if (!done) std::fprintf(stderr, "sonoplay: %s\n", done.error().message().c_str());
}

Status save_screenshot(const Window& window, const std::string& path) {
    const Window::Capture& picture = window.captured();
    if (picture.pixels.empty()) return Done{};
    return write_png(path, picture.width_px, picture.height_px, 3, picture.pixels);
}

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
        constexpr double kLook = 0.5;  // a signal is seen within it
        constexpr double kEarly = 2e-3;
        for (double now = steady_seconds(); now < until_s && !g_asked_to_end;) {
            const double wait_s = std::min(until_s - now, kLook);
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

class WindowRun {
  public:
    WindowRun(const PlayerArguments& arguments, double start_s) : start_s_(start_s) {
        app_.player.arguments = arguments;
        app_.player.clock_start_s = steady_seconds();
    }

    Status set_up();
    void show_pictures();
    void finish();

  private:
    Status open_window();
    void start_scanning();
    Stillness stillness(const PictureClock& clock) const;
    void show_picture(const PictureClock& clock);
    void keep_settings();

    double start_s_;  // of the process
    App app_;
    Ui ui_, instructor_ui_;
    InputScript script_;
    WindowStats stats_;
    int shown_ = 0;                  // pictures
    std::uint64_t shown_frame_ = 0;  // number of the frame that the texture holds
    bool was_frozen_ = false, was_outlined_ = false;
};

Status WindowRun::set_up() {
    PlayerState& player = app_.player;
    const PlayerArguments& arguments = player.arguments;
    if (!config_folder().empty()) player.settings_file = config_folder() + "/player.json";
    std::string warning;
    player.settings = load_settings(player.settings_file, warning);
    if (!arguments.script.empty()) {
        Result<InputScript> script = InputScript::load(arguments.script);
        if (!script) return script.error();
        script_ = std::move(*script);
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
    const Status calibrated = load_initial_calibrations(player, app_.loaded, app_.view.notices);
    if (!calibrated) return calibrated;
    apply_settings(player.settings, app_.scan.controls);
    use_language(player.settings.language.empty() ? locale_language() : player.settings.language);
    if (Status opened = open_window(); !opened) return opened;
    start_scanning();
    if (!warning.empty()) app_.view.notices.warning(warning);
    const std::string kept_trainee = player.settings.trainee;
    sign_in(app_, arguments.trainee.empty() ? kept_trainee : arguments.trainee);
    player.settings.trainee = kept_trainee;  // that of the command line is for this run
    show_bundles(player, app_.view);
    if (!arguments.bundle.empty() && open_bundle(app_, arguments.bundle, arguments.exercise) &&
        !arguments.record.empty()) {
        start_attempt(app_, arguments.record);
    }
    return Done{};
}

Status WindowRun::open_window() {
    const PlayerArguments& arguments = app_.player.arguments;
    const Settings& settings = app_.player.settings;
    app_.view.instructor.wanted = arguments.instructor;
    WindowOptions options;
    options.width_px = arguments.width_px > 0 ? arguments.width_px : settings.window_width_px;
    options.height_px = arguments.height_px > 0 ? arguments.height_px : settings.window_height_px;
    options.ui_scale = arguments.ui_scale > 0 ? arguments.ui_scale : settings.ui_scale;
    Result<std::unique_ptr<Window>> window = Window::open(options);
    if (!window) return window.error();
    app_.view.window = std::move(*window);
    app_.view.window->set_fitting_scale(effective_scale);
    app_.view.texture = std::make_unique<ImageTexture>();
    app_.view.strip = std::make_unique<ImageTexture>();
    app_.view.small_view.view = std::make_unique<View3d>();
    // The first engine already makes pictures of the size that they are shown in.
    const Window::Size size = app_.view.window->size();
    const float scale =
        effective_scale(size.width_px, size.height_px, app_.view.window->asked_scale());
    const ScanLayout layout = scan_layout(static_cast<float>(size.width_px) / scale,
                                          static_cast<float>(size.height_px) / scale);
    const PictureSize picture = picture_size(layout.picture, scale);
    app_.loaded.image.width_px = picture.width_px;
    app_.loaded.image.height_px = picture.height_px;
    return Done{};
}

void WindowRun::start_scanning() {
    const PlayerArguments& arguments = app_.player.arguments;
    const double clock_start_s = app_.player.clock_start_s;
    CaseState& loaded = app_.loaded;
    loaded.scan = std::make_unique<ScanThread>(session_clock(clock_start_s));
    loaded.scan->set_program_start_s(start_s_ - clock_start_s);
    loaded.scan->set_calibrations(loaded.calibrations);
    app_.scan.tracker.spec = arguments.tracker.empty() ? "mouse" : arguments.tracker;
    const auto keep = [&](auto server, auto& to) {
        if (server) {
            to = std::move(*server);
        } else {
            app_.view.notices.error(server.error().message());
        }
    };
    if (!arguments.serve.empty()) keep(IgtlServer::start(arguments.serve), app_.scan.server);
    if (!arguments.serve_poses.empty())
        keep(PoseServer::start(arguments.serve_poses), app_.scan.poses);
    if (app_.scan.poses) {
        std::printf("poses for pages: %s\n", app_.scan.poses->url().c_str());
        std::fflush(stdout);
    }
    observe_frames(app_.scan, *loaded.scan);
}

// Pages without a picture stand still, and so does a frozen picture.
Stillness WindowRun::stillness(const PictureClock& clock) const {
    const ScanState& scan = app_.scan;
    const ViewState& view = app_.view;
    constexpr double kFollows = 0.3;  // s until what an input asked for is rendered
    const bool frozen = scan.controls.frozen && app_.loaded.frame().frozen && !scan.cine.playing &&
                        !scan.clip && !scan.attempt && scan.tracker.mouse && shown_ > 0 &&
                        shown_frame_ == app_.loaded.frame().number &&
                        steady_seconds() - clock.input_s() > kFollows;
    Stillness now;
    now.scanning = (view.page == Page::scan && !frozen) || script_.active() ||
                   app_.player.arguments.frames > 0;
    now.key_held = view.window->key_held();
    now.loading =
        (view.chooser.cards && view.chooser.cards->busy()) || view.small_view.view->busy();
    now.notice = !view.notices.standing().empty();
    now.typing = view.window->typing();
    now.input_s_ago = steady_seconds() - clock.input_s();
    return now;
}

void WindowRun::show_pictures() {
    PictureClock clock;
    while (!app_.view.window->should_close()) {
        clock.wait(*app_.view.window, longest_wait_s(stillness(clock)));
        if (g_asked_to_end) app_.view.window->request_close();
        app_.player.now_s = clock.now_s() - app_.player.clock_start_s;
        app_.view.pictures_per_s = clock.rate();
        show_picture(clock);
    }
}

void WindowRun::show_picture(const PictureClock& clock) {
    const PlayerArguments& arguments = app_.player.arguments;
    ViewState& view = app_.view;
    CaseState& loaded = app_.loaded;
    Window& window = *view.window;
    const double now_s = app_.player.now_s;
    view.notices.set_now_s(now_s);
    check_bundle(loaded, view.notices);

    std::string shot, instructor_shot;
    bool quit = false;
    InjectedInput input;
    const bool scripted = script_.active();
    input.active = scripted;
    // A script waits for what is made beside it, so that its pictures show the same on any machine.
    if (scripted && !view.small_view.view->busy()) {
        input = script_.next(now_s, shot, quit);
        if (script_.of_instructor()) instructor_shot.swap(shot);
    }
    view.small_view.saved = !shot.empty();
    window.begin_frame(input);
    const bool fresh = loaded.scan->refresh();
    if (fresh || view.look.outlines != was_outlined_) show_frame(app_);
    was_outlined_ = view.look.outlines;
    shown_frame_ = loaded.frame().number;
    ui_.begin(window.scale(), now_s);
    if (const std::string dropped = window.dropped_file(); !dropped.empty())
        open_bundle(app_, dropped, "");
    // A key that a script holds moves as far on a slow machine as on a fast one.
    handle_keys(app_, ui_, scripted ? kPictureTime : clock.seconds());
    advance_clip(app_);
    // Calipers belong to the picture that they were set on.
    if (was_frozen_ && !app_.scan.controls.frozen) clear_marks(view);
    was_frozen_ = app_.scan.controls.frozen;
    advance_cine(app_.scan, loaded.frame().cine_frames, now_s);
    const TrackerHealth tracker = loaded.scan->tracker_health();
    check_device(app_.scan.tracker, tracker, loaded, view.notices);
    note_readings(app_.scan.tracker, loaded, loaded.frame().frozen, now_s);
    draw_page(app_, ui_, tracker);
    follow_sounds(app_);
    feed_mouse(app_.scan.tracker, steady_seconds() - app_.player.clock_start_s);
    app_.scan.controls.resting = view.page != Page::scan && !app_.scan.attempt && !app_.scan.server;
    if (loaded.open) loaded.scan->set_controls(app_.scan.controls);

    ++shown_;
    if (arguments.frames > 0 && shown_ >= arguments.frames) quit = true;
    const bool last = quit || window.should_close();
    const double drawn_s = steady_seconds();
    window.end_frame(!shot.empty() || (last && !arguments.screenshot.empty()));
    if (shown_ > 1) {
        stats_.add(clock.between_s(), 1e3 * (drawn_s - clock.now_s()),
                   1e3 * (steady_seconds() - drawn_s));
    }
    if (!shot.empty()) {
        Status saved = save_screenshot(window, shot);
        if (saved) saved = write_boxes(ui_, shot);
        if (!saved) view.notices.error(saved.error().message());
    }
    if (const Status shown =
            follow_instructor_window(app_, instructor_ui_, tracker, instructor_shot);
        !shown)
        view.notices.error(shown.error().message());
    if (quit) window.request_close();
}

void WindowRun::keep_settings() {
    const ScanControls& controls = app_.scan.controls;
    Settings& s = app_.player.settings;
    s.gain_db = controls.settings.gain_db;
    s.dynamic_range_db = controls.settings.dynamic_range_db;
    for (std::size_t i = 0; i < 8; ++i) s.tgc_db[i] = controls.settings.tgc_db[i];
    s.probe_sensor = controls.assignment.probe;
    s.needle_sensor = controls.assignment.needle;
    if (app_.player.arguments.tracker.empty()) s.tracker = app_.scan.tracker.spec;
    if (!app_.player.settings_file.empty()) report(save_settings(s, app_.player.settings_file));
}

void WindowRun::finish() {
    const PlayerArguments& arguments = app_.player.arguments;
    if (!arguments.screenshot.empty())
        report(save_screenshot(*app_.view.window, arguments.screenshot));
    finish_attempt(app_);
    if (!arguments.stats.empty()) {
        const bool scored = app_.scan.score && app_.loaded.open;
        const std::string score =
            scored ? score_json(*app_.scan.score, app_.loaded.exercise()) : "";
        report(
            write_text_output(arguments.stats, app_.loaded.scan->stats_json(score, stats_.json())));
    }
    keep_settings();
    close_bundle(app_);
    app_.view.instructor.window.reset();
    app_.loaded.scan.reset();
}

}  // namespace

Status run_window(const PlayerArguments& arguments, double start_s) {
    WindowRun run(arguments, start_s);
    if (Status done = run.set_up(); !done) return done;
    for (const int signal : {SIGTERM, SIGINT, SIGHUP}) std::signal(signal, ask_to_end);
    run.show_pictures();
    run.finish();
    return Done{};
}

}  // namespace sonocase::runtime
