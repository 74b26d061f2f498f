// SPDX-License-Identifier: Apache-2.0

#include "runtime/player/app.h"
#include "runtime/player/session_run.h"
#include "runtime/player/setup_guide.h"

#include <GLFW/glfw3.h>
#include <imgui.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <filesystem>

#include "formats/files/bundle_file.h"
#include "runtime/display/theme.h"
#include "runtime/player/headless.h"
#include "runtime/player/png_file.h"
#include "runtime/tracking/factory/make_tracker.h"
#include "runtime/workers/thread_host.h"

namespace sonocase::runtime {

void notify(App& app, Notice::Kind kind, const std::string& text) {
    if (kind != Notice::Kind::news) std::fprintf(stderr, "sonoplay: %s\n", text.c_str());
    for (Notice& notice : app.notices) {
        if (notice.text == text) {
            notice.since_s = app.now_s;
            return;
        }
    }
    app.notices.push_back({kind, text, app.now_s});
    if (app.notices.size() > 4) app.notices.erase(app.notices.begin());
}

void rebuild_engine(App& app, bool keep_session) {
    EngineOptions options;
    RenderOptions& render = options.render;
    render.width_px = app.arguments.width_px > 0 && app.arguments.headless ? app.arguments.width_px
                                                                           : app.render_px;
    render.height_px = render.width_px;
    render.model = app.model == "paper" ? ImageModel::paper : ImageModel::physical;
    render.kind =
        app.arguments.renderer == "reference" ? RendererKind::reference : RendererKind::fast;
    render.threads = app.arguments.threads;
    render.read_ahead = true;
    if (!app.textures) app.textures = make_physical_textures();
    render.textures = app.textures;
    render.host = thread_host();
    render.scanlines = app.arguments.scanlines;
    render.samples = app.arguments.samples;
    render.effects = app.arguments.effects.empty() ? app.current().effects : app.arguments.effects;
    // A recording is replayed to the same pixels, which a governor would not give.
    render.frame_budget_ms = app.exact ? 0 : app.arguments.frame_budget_ms;
    options.depth_mm = app.depth_mm;
    options.focus_mm = app.focus_mm;
    Result<ScanEngine> engine = ScanEngine::create(app.open->bundle, app.current(), options);
    if (!engine && render.effects != std::vector<std::string>{"auto"}) {
        // The effects named may be those of the other model.
        render.effects = {"auto"};
        engine = ScanEngine::create(app.open->bundle, app.current(), options);
    }
    if (!engine) {
        notify(app, Notice::Kind::error, engine.error().message());
        return;
    }
    app.controls.frozen = false;
    app.cine_back = app.controls.cine_back = 0;
    app.scan->set_controls(app.controls);
    app.anatomy = engine->anatomy();
    app.scan->set_engine(std::make_unique<ScanEngine>(std::move(*engine)), keep_session);
}

void close_bundle(App& app) {
    if (app.scan) {
        finish_attempt(app);
        app.scan->set_tracker(nullptr);
        app.scan->set_engine(nullptr);
    }
    app.guide.reset();
    app.mouse.reset();
    app.mouse_feed.reset();
    app.paced.reset();
    app.anatomy.reset();
    app.skin.reset();
    app.open.reset();
}

bool open_bundle(App& app, const std::string& path, const std::string& exercise) {
    Result<std::unique_ptr<OpenCase>> opened = open_case(path);
    if (!opened) {
        notify(app, Notice::Kind::error, opened.error().message());
        return false;
    }
    Result<int> index = find_exercise(**opened, exercise);
    if (!index) {
        notify(app, Notice::Kind::error, index.error().message());
        index = 0;
    }
    close_bundle(app);
    app.open = std::move(*opened);
    app.damage_told = false;
    for (const std::string& warning : app.open->warnings)
        notify(app, Notice::Kind::warning, warning);
    app.skin = std::make_unique<Skin>(app.open->bundle);
    app.view3d->set_case(app.open->bundle);
    app.page = Page::scan;
    choose_exercise(app, *index);
    app.window->set_title(app.open->bundle.manifest.case_name + " - sonocase");
    std::error_code ignored;
    const std::string whole = std::filesystem::weakly_canonical(path, ignored).string();
    auto& recent = app.settings.recent;
    recent.erase(std::remove(recent.begin(), recent.end(), whole), recent.end());
    recent.insert(recent.begin(), whole);
    if (recent.size() > 12) recent.resize(12);
    return true;
}

void choose_exercise(App& app, int index) {
    finish_attempt(app);
    app.score.reset();
    const int count = static_cast<int>(app.open->exercises.size());
    app.exercise = (index % count + count) % count;
    const Exercise& exercise = app.current();
    app.model = app.arguments.model.empty() ? exercise.model : app.arguments.model;
    app.depth_mm = exercise.probe.depth_mm;
    app.focus_mm = exercise.probe.focus_mm;
    app.hits.assign(exercise.targets.size(), false);
    app.image.clear_measurements();
    app.view3d->set_exercise(exercise);
    app.scan->set_tracker(nullptr);
    rebuild_engine(app, false);
    choose_tracker(app, app.tracker_spec);
}

void choose_tracker(App& app, const std::string& spec) {
    app.scan->set_tracker(nullptr);
    app.mouse.reset();
    app.mouse_feed.reset();
    app.paced.reset();
    app.checked_device.clear();
    app.tracker_spec = spec;
    if (spec == "mouse") {
        app.mouse = std::make_unique<MouseTracker>(*app.skin, app.current());
        app.mouse_feed = std::make_shared<PushTracker>("Mouse and keyboard");
        app.scan->set_tracker(app.mouse_feed);
        return;
    }
    TrackerContext context;
    context.skin = app.skin.get();
    context.exercise = &app.current();
    const double start_s = app.clock_start_s;
    context.clock = [start_s] { return steady_seconds() - start_s; };
    context.loop = true;
    context.needle_lag_s = app.calibrations.needle_lag_s;
    Result<std::unique_ptr<Tracker>> made = make_tracker(spec, context);
    if (!made) {
        notify(app, Notice::Kind::error, made.error().message());
        if (spec != "mouse") choose_tracker(app, "mouse");
        return;
    }
    if ((*made)->duration_s() > 0) {
        app.paced = std::make_shared<PacedTracker>(std::move(*made));
        app.scan->set_tracker(app.paced);
        return;
    }
    app.scan->set_tracker(std::shared_ptr<Tracker>(std::move(*made)));
}

void change_pace(App& app, int steps) {
    if (!app.paced) return;
    constexpr double kSpeeds[] = {0, 0.1, 0.25, 0.5, 1, 2, 4, 8};
    constexpr int kCount = static_cast<int>(std::size(kSpeeds));
    int at = 0;
    while (at + 1 < kCount && kSpeeds[at] < app.paced->speed()) ++at;
    app.paced->set_speed(kSpeeds[std::clamp(at + steps, 0, kCount - 1)]);
}

Point3 target_now(const App& app, std::size_t target) {
    const Point3 centre = app.current().targets[target].centre;
    return app.anatomy ? app.anatomy->moved(centre, app.frame().record.input.time_s) : centre;
}

void change_depth(App& app, double by_mm) {
    const double depth = std::clamp(std::round((app.depth_mm + by_mm) / 10) * 10, 30.0, 300.0);
    if (depth == app.depth_mm) return;
    app.depth_mm = depth;
    app.focus_mm = std::min(app.focus_mm, depth);
    rebuild_engine(app);
}

void change_focus(App& app, double by_mm) {
    const double focus = std::clamp(std::round((app.focus_mm + by_mm) / 5) * 5, 10.0, app.depth_mm);
    if (focus == app.focus_mm) return;
    app.focus_mm = focus;
    rebuild_engine(app);
}

void set_frozen(App& app, bool frozen) {
    app.controls.frozen = frozen;
    app.cine_back = app.controls.cine_back = 0;
    app.playing_cine = false;
}

void step_cine(App& app, int frames) {
    if (!app.controls.frozen) set_frozen(app, true);
    app.cine_back = std::clamp(app.cine_back + frames, 0, std::max(app.frame().cine_frames - 1, 0));
    app.controls.cine_back = app.cine_back;
}

void toggle_needle(App& app, bool in_plane) {
    if (!app.mouse) return;
    if (app.mouse->has_needle()) {
        app.mouse->withdraw_needle();
        return;
    }
    // Beside the face: far enough that hand and probe do not meet.
    const Probe& probe = app.current().probe;
    const double half = probe.shape == ProbeShape::curvilinear
                            ? probe.radius_mm * std::sin(0.5 * probe.field_of_view_rad)
                            : 0.5 * probe.width_mm;
    if (!app.mouse->place_needle_beside_probe(in_plane ? half + 8 : 18, in_plane)) {
        notify(app, Notice::Kind::news, "There is no skin beside the probe to put the needle on.");
    }
}

namespace {

// Each live frame goes to the attempt and to the server, as far as there are any.
void watch_frames(App& app) {
    if (!app.attempt && !app.server) {
        app.scan->set_observer({});
        return;
    }
    app.scan->set_observer([attempt = app.attempt, server = app.server](const ScanFrame& frame) {
        if (attempt) attempt->observe(frame.record, frame.width_px, frame.height_px, frame.pixels);
        if (server) {
            serve_frame(*server, frame.record, frame.layout, frame.width_px, frame.height_px,
                        unix_seconds(), frame.pixels);
        }
    });
}

}  // namespace

void start_attempt(App& app, const std::string& path) {
    if (app.attempt || !app.open) return;
    std::string file = path;
    if (file.empty())
        file = new_session_path(app.open->bundle.manifest.case_name, app.current().name);
    if (file.empty()) {
        notify(app, Notice::Kind::error,
               "There is no folder to record to: set HOME or XDG_DATA_HOME.");
        return;
    }
    const bool governed = app.arguments.frame_budget_ms > 0;
    app.exact = true;
    if (governed) rebuild_engine(app);
    Result<std::unique_ptr<SessionRun>> run = Error{"there is no picture to record", file, ""};
    const double now_s = steady_seconds() - app.clock_start_s;
    app.scan->with_engine([&](ScanEngine& engine) {
        run = SessionRun::start(file, *app.open, engine, app.arguments.trainee, utc_now(), now_s);
    });
    if (!run) {
        notify(app, Notice::Kind::error, run.error().message());
        app.exact = false;
        if (governed) rebuild_engine(app);
        return;
    }
    app.attempt = std::make_shared<Attempt>(*app.open, app.current(), std::move(*run));
    app.score.reset();
    app.hits.assign(app.hits.size(), false);
    watch_frames(app);
}

void finish_attempt(App& app) {
    if (!app.attempt) return;
    const std::shared_ptr<Attempt> attempt = std::move(app.attempt);
    watch_frames(app);  // returns when the scan thread has let go of the attempt
    app.exact = false;
    if (app.arguments.frame_budget_ms > 0) rebuild_engine(app);
    Result<SessionScore> score = attempt->finish();
    if (score) {
        app.score = std::move(*score);
        app.score_file = attempt->path();
        app.show_score = true;
    } else {
        notify(app, Notice::Kind::error, score.error().message());
    }
}

Status save_screenshot(App& app, const std::string& path) {
    const Window::Capture& picture = app.window->captured();
    if (picture.pixels.empty()) return Done{};
    return write_png(path, picture.width_px, picture.height_px, 3, picture.pixels);
}

namespace {

void apply_settings(App& app) {
    const Settings& s = app.settings;
    app.controls.settings.gain_db = s.gain_db;
    app.controls.settings.dynamic_range_db = s.dynamic_range_db;
    for (std::size_t i = 0; i < 8; ++i) app.controls.settings.tgc_db[i] = s.tgc_db[i];
    app.controls.assignment = {s.probe_sensor, s.needle_sensor};
}

void keep_settings(App& app) {
    Settings& s = app.settings;
    s.gain_db = app.controls.settings.gain_db;
    s.dynamic_range_db = app.controls.settings.dynamic_range_db;
    for (std::size_t i = 0; i < 8; ++i) s.tgc_db[i] = app.controls.settings.tgc_db[i];
    s.probe_sensor = app.controls.assignment.probe;
    s.needle_sensor = app.controls.assignment.needle;
    if (app.arguments.tracker.empty()) s.tracker = app.tracker_spec;
    if (app.settings_file.empty()) return;
    const Status saved = save_settings(s, app.settings_file);
    if (!saved) std::fprintf(stderr, "sonoplay: %s\n", saved.error().message().c_str());
}

void draw(App& app) {
    const ImGuiIO& io = ImGui::GetIO();
    ImGui::SetNextWindowPos({0, 0});
    ImGui::SetNextWindowSize(io.DisplaySize);
    ImGui::Begin("sonocase", nullptr,
                 ImGuiWindowFlags_NoDecoration | ImGuiWindowFlags_NoMove | ImGuiWindowFlags_NoNav |
                     ImGuiWindowFlags_NoBackground | ImGuiWindowFlags_NoBringToFrontOnFocus |
                     ImGuiWindowFlags_NoSavedSettings);
    if (app.page == Page::bundles || !app.open) {
        draw_bundle_page(app);
    } else {
        draw_scan_page(app);
    }
    ImGui::End();
    if (app.show_help) draw_help(app);
    if (app.show_setup && app.open && app.page == Page::scan) draw_setup(app);
    if (app.show_score && app.score && app.page == Page::scan) draw_score_window(app);
    draw_notices(app);
}

// What the tracker has to say, and once for each device whether the calibrations in use are its
// own.
void check_device(App& app) {
    if (app.mouse || app.paced || !app.open) return;
    const TrackerHealth health = app.scan->tracker_health();
    // The tracker's panel shows it; who started the player from a terminal reads it there.
    if (!health.message.empty() && app.told.insert(health.message).second) {
        std::fprintf(stderr, "sonoplay: %s\n", health.message.c_str());
    }
    if (health.phase != TrackerPhase::streaming || health.device == app.checked_device) return;
    app.checked_device = health.device;
    for (const std::string& doubt : sensor_mismatch_warnings(app.calibrations, health.device)) {
        notify(app, Notice::Kind::warning, doubt);
    }
}

void advance_cine(App& app) {
    if (!app.playing_cine) return;
    if (app.now_s - app.cine_clock_s < 1 / kCineRate) return;
    app.cine_clock_s = app.now_s;
    app.cine_back =
        app.cine_back > 0 ? app.cine_back - 1 : std::max(app.frame().cine_frames - 1, 0);
    app.controls.cine_back = app.cine_back;
}

}  // namespace

Status run_window(const PlayerArguments& arguments, double start_s) {
    App app;
    app.arguments = arguments;
    app.clock_start_s = steady_seconds();
    if (!config_folder().empty()) app.settings_file = config_folder() + "/player.json";
    std::string warning;
    app.settings = load_settings(app.settings_file, warning);
    if (!arguments.script.empty()) {
        Result<InputScript> script = InputScript::load(arguments.script);
        if (!script) return script.error();
        app.script = std::move(*script);
    }
    if (arguments.calibrations.empty()) {
        // Saved ones that cannot be read any more are no reason not to start.
        for (const std::string& file : app.settings.calibrations) {
            const Result<Calibrations> saved = load_calibrations({file});
            if (!saved) {
                notify(app, Notice::Kind::warning, saved.error().message());
                continue;
            }
            if (saved->probe) app.calibrations.probe = saved->probe;
            if (saved->needle) app.calibrations.needle = saved->needle;
            if (saved->mannequin) app.calibrations.mannequin = saved->mannequin;
        }
    } else {
        const Result<Calibrations> calibrations = load_calibrations(arguments.calibrations);
        if (!calibrations) return calibrations.error();
        app.calibrations = *calibrations;
    }
    for (const std::string& doubt : calibration_warnings(app.calibrations, "", utc_now())) {
        notify(app, Notice::Kind::warning, doubt);
    }
    apply_settings(app);
    WindowOptions options;
    options.width_px = arguments.width_px > 0 ? arguments.width_px : app.settings.window_width_px;
    options.height_px =
        arguments.height_px > 0 ? arguments.height_px : app.settings.window_height_px;
    options.ui_scale = arguments.ui_scale > 0 ? arguments.ui_scale : app.settings.ui_scale;
    Result<std::unique_ptr<Window>> window = Window::open(options);
    if (!window) return window.error();
    app.window = std::move(*window);
    app.texture = std::make_unique<ImageTexture>();
    app.view3d = std::make_unique<View3d>();
    const double clock_start_s = app.clock_start_s;
    app.scan =
        std::make_unique<ScanThread>([clock_start_s] { return steady_seconds() - clock_start_s; });
    app.scan->set_first_frame_origin_s(start_s - clock_start_s);
    app.scan->set_calibrations(app.calibrations);
    app.tracker_spec = arguments.tracker.empty() ? "mouse" : arguments.tracker;
    if (!arguments.serve.empty()) {
        Result<std::unique_ptr<IgtlServer>> server = IgtlServer::start(arguments.serve);
        if (server) {
            app.server = std::move(*server);
            watch_frames(app);
        } else {
            notify(app, Notice::Kind::error, server.error().message());
        }
    }
    if (!warning.empty()) notify(app, Notice::Kind::warning, warning);
    app.bundles = find_bundles(app.settings);
    if (!arguments.bundle.empty() && open_bundle(app, arguments.bundle, arguments.exercise) &&
        !arguments.record.empty()) {
        start_attempt(app, arguments.record);
    }

    double last_s = steady_seconds(), last_shown_s = last_s;
    std::uint64_t shown = 0;
    while (!app.window->should_close()) {
        // 60 pictures a second; a display that paces itself through the swap is not slowed further.
        const double due_s = last_s + 1 / 60.0;
        do {
            app.window->wait_events(std::max(0.0, due_s - steady_seconds()));
        } while (steady_seconds() < due_s - 5e-4 && !app.window->should_close());
        const double now_s = steady_seconds();
        const double seconds = std::min(now_s - last_s, 0.1);
        last_s = std::max(due_s, now_s - 1 / 60.0);
        app.now_s = now_s - app.clock_start_s;
        const double between_s = now_s - last_shown_s;
        if (between_s > 0) app.ui_rate += 0.08 * (1 / between_s - app.ui_rate);
        last_shown_s = now_s;

        const VoxelBlocks* blocks = app.open ? app.open->bundle.blocks.get() : nullptr;
        if (blocks && blocks->damaged() && !app.damage_told) {
            notify(app, Notice::Kind::error, blocks->status().error().message());
            app.damage_told = true;
        }

        std::string shot;
        bool quit = false;
        InjectedInput input;
        if (app.script.active()) input = app.script.next(app.now_s, shot, quit);
        app.window->begin_frame(input);
        const bool fresh = app.scan->refresh();
        if (fresh && app.frame().width_px > 0) {
            app.texture->upload(app.frame().pixels, app.frame().width_px, app.frame().height_px);
        }
        handle_keys(app, seconds);
        advance_cine(app);
        check_device(app);
        draw(app);
        if (app.mouse && app.mouse_feed) {
            TrackerReading reading;
            if (app.mouse->poll(steady_seconds() - app.clock_start_s, reading)) {
                app.mouse_feed->push(reading);
            }
        }
        if (app.open) app.scan->set_controls(app.controls);
        ++shown;
        if (arguments.frames > 0 && shown >= static_cast<std::uint64_t>(arguments.frames))
            quit = true;
        const bool last = quit || app.window->should_close();
        const double drawn_s = steady_seconds();
        app.window->end_frame(!shot.empty() || (last && !arguments.screenshot.empty()));
        if (shown > 1) {
            app.window_stats.add(between_s, 1e3 * (drawn_s - now_s),
                                 1e3 * (steady_seconds() - drawn_s));
        }
        if (fresh) {
            app.screen_ms =
                1e3 * (steady_seconds() - app.clock_start_s - app.frame().record.reading_time_s);
        }
        if (!shot.empty()) {
            const Status saved = save_screenshot(app, shot);
            if (!saved) notify(app, Notice::Kind::error, saved.error().message());
        }
        if (quit) app.window->request_close();
    }
    if (!arguments.screenshot.empty()) {
        const Status saved = save_screenshot(app, arguments.screenshot);
        if (!saved) std::fprintf(stderr, "sonoplay: %s\n", saved.error().message().c_str());
    }
    finish_attempt(app);
    if (!arguments.stats.empty()) {
        const std::string score =
            app.score && app.open ? score_json(*app.score, app.current()) : "";
        const Status written =
            write_text_file(arguments.stats, app.scan->stats_json(score, app.window_stats.json()));
        if (!written) std::fprintf(stderr, "sonoplay: %s\n", written.error().message().c_str());
    }
    keep_settings(app);
    close_bundle(app);
    app.scan.reset();
    app.view3d.reset();
    app.texture.reset();
    return Done{};
}

}  // namespace sonocase::runtime
