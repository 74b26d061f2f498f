// SPDX-License-Identifier: Apache-2.0

#include "runtime/player/headless.h"

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <memory>
#include <optional>
#include <thread>

#include "formats/base/event.h"
#include "formats/files/atomic_file.h"
#include "runtime/engine/scan_engine.h"
#include "runtime/player/contact_sheet.h"
#include "runtime/player/frame_stats.h"
#include "runtime/player/open_case.h"
#include "runtime/player/png_file.h"
#include "runtime/player/serve.h"
#include "runtime/player/session_run.h"
#include "runtime/player/setup_guide.h"
#include "runtime/recording/settings_text.h"
#include "runtime/tracking/factory/make_tracker.h"
#include "runtime/workers/thread_host.h"

namespace sonocase::runtime {
namespace {

constexpr double kFrameRate = 30;   // of scripted runs, when --frames does not spread them
constexpr double kDeviceWait = 10;  // seconds for the first reading of a device

// When frame i of n is rendered, on the session's clock.
double frame_time_s(const Tracker& tracker, int i, int n) {
    const int recorded = tracker.recorded_readings();
    if (recorded > 0) {
        const int lap = i / recorded;
        return lap * (tracker.duration_s() + 1 / kFrameRate) +
               tracker.recorded_time_s(i % recorded);
    }
    const double duration = tracker.duration_s();
    if (duration > 0 && n > 1) return duration * i / (n - 1);
    return i / kFrameRate;
}

int frame_count(const PlayerArguments& arguments, const Tracker& tracker) {
    if (arguments.frames > 0) return arguments.frames;
    if (tracker.recorded_readings() > 0) return tracker.recorded_readings();
    if (tracker.duration_s() > 0) return static_cast<int>(tracker.duration_s() * kFrameRate) + 1;
    return tracker.is_device() ? 300 : 1;
}

}  // namespace

Status write_text_file(const std::string& path, const std::string& text) {
    if (path == "-") {
        std::fwrite(text.data(), 1, text.size(), stdout);
        return Done{};
    }
    return write_file(path, text);
}

double steady_seconds() {
    return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch())
        .count();
}

Result<Calibrations> load_calibrations(const std::vector<std::string>& files) {
    Calibrations calibrations;
    for (const std::string& file : files) {
        const Result<std::string> text = read_text_file(file);
        if (!text) return text.error();
        const Result<std::optional<double>> lag = parse_lag_s(*text, file);
        if (!lag) return lag.error();
        if (*lag) {
            calibrations.needle_lag_s = **lag;
            continue;
        }
        Result<Calibration> calibration = parse_calibration(*text, file);
        if (!calibration) return calibration.error();
        std::optional<Calibration>* place = nullptr;
        if (calibration->kind == "probe") place = &calibrations.probe;
        if (calibration->kind == "needle") place = &calibrations.needle;
        if (calibration->kind == "mannequin") place = &calibrations.mannequin;
        if (!place) {
            return Error{"kind is \"" + calibration->kind + "\"", file,
                         "expected probe, needle or mannequin; make one with sonocase calibrate"};
        }
        if (*place) {
            return Error{"second calibration of the " + calibration->kind, file,
                         "give one --calibration of each kind"};
        }
        *place = std::move(*calibration);
    }
    return calibrations;
}

Status run_headless(const PlayerArguments& arguments, double start_s) {
    if (arguments.bundle.empty()) {
        return Error{"no bundle given", "", "sonoplay BUNDLE --headless needs one"};
    }
    // What depends on no bundle is made while the bundle is read.
    std::shared_ptr<const PhysicalTextures> textures;
    std::thread making([&textures] {
        try {
            textures = make_physical_textures();
        } catch (const std::bad_alloc&) {  // the renderer makes its own, or says so
        }
    });
    Result<std::unique_ptr<OpenCase>> opened = open_case(arguments.bundle);
    making.join();
    if (!opened) return opened.error();
    const OpenCase& open = **opened;
    for (const std::string& warning : open.warnings) {
        std::fprintf(stderr, "sonoplay: %s\n", warning.c_str());
    }
    const Result<int> index = find_exercise(open, arguments.exercise);
    if (!index) return index.error();
    const Exercise& exercise = open.exercises[static_cast<std::size_t>(*index)];
    const Result<Calibrations> calibrations = load_calibrations(arguments.calibrations);
    if (!calibrations) return calibrations.error();
    for (const std::string& doubt : calibration_warnings(*calibrations, "", utc_now())) {
        std::fprintf(stderr, "sonoplay: %s\n", doubt.c_str());
    }

    EngineOptions options;
    RenderOptions& render = options.render;
    if (arguments.width_px > 0) {
        render.width_px = arguments.width_px;
        render.height_px = arguments.height_px;
    }
    const std::string model = arguments.model.empty() ? exercise.model : arguments.model;
    render.model = model == "paper" ? ImageModel::paper : ImageModel::physical;
    render.kind = arguments.renderer == "reference" ? RendererKind::reference : RendererKind::fast;
    render.threads = arguments.threads;
    render.read_ahead = true;
    render.textures = std::move(textures);
    render.host = thread_host();
    render.scanlines = arguments.scanlines;
    render.samples = arguments.samples;
    render.effects = arguments.effects.empty() ? exercise.effects : arguments.effects;
    Result<ScanEngine> engine = ScanEngine::create(open.bundle, exercise, options);
    if (!engine) return engine.error();
    engine->set_calibrations(*calibrations);

    const Skin skin(open.bundle);
    TrackerContext context;
    context.skin = &skin;
    context.exercise = &exercise;
    const double clock_start_s = steady_seconds();
    context.clock = [clock_start_s] { return steady_seconds() - clock_start_s; };
    context.loop = true;
    context.needle_lag_s = calibrations->needle_lag_s;
    std::string spec = arguments.tracker;
    if (spec.empty()) spec = exercise.sweeps.empty() ? "null" : "sweep";
    Result<std::unique_ptr<Tracker>> made = make_tracker(spec, context);
    if (!made) return made.error();
    Tracker& tracker = **made;

    Event bell;
    tracker.set_wake([&bell] { bell.ring(); });
    const struct Silence {
        Tracker& tracker;
        ~Silence() { tracker.set_wake({}); }  // before the bell is gone
    } silence{tracker};

    if (!arguments.out.empty()) {
        std::error_code failed;
        std::filesystem::create_directories(arguments.out, failed);
        if (failed) {
            return Error{"cannot make the folder: " + failed.message(), arguments.out,
                         "check the path and its permissions"};
        }
    }
    std::vector<std::uint8_t> pixels(static_cast<std::size_t>(render.width_px) * render.height_px);
    FrameStats stats;
    TimeHistogram pose_to_pixel;
    stats.set_effects(engine->renderer().costs());
    ImageSettings settings;
    // A replayed session brings the console's settings along.
    std::optional<SessionReplay> replay;
    if (spec.compare(0, 7, "replay:") == 0) replay = session_replay(spec.substr(7));
    std::unique_ptr<SessionRun> session;
    if (!arguments.record.empty()) {
        auto started =
            SessionRun::start(arguments.record, open, *engine, arguments.trainee, utc_now(), 0);
        if (!started) return started.error();
        session = std::move(*started);
    }
    std::unique_ptr<IgtlServer> server;
    if (!arguments.serve.empty()) {
        auto started = IgtlServer::start(arguments.serve);
        if (!started) return started.error();
        server = std::move(*started);
    }
    const int frames = frame_count(arguments, tracker);
    ContactSheet sheet(frames, std::max(render.width_px, 2), std::max(render.height_px, 2));
    const bool has_sheet = !arguments.out.empty() && render.width_px > 1 && render.height_px > 1;
    for (int i = 0; i < frames; ++i) {
        double now_s = frame_time_s(tracker, i, frames);
        TrackerReading reading;
        bool fresh = false;
        if (tracker.is_device()) {
            // Live input has its own clock: wait for what comes.
            const double give_up_s = context.clock() + kDeviceWait;
            while (!(fresh = tracker.poll(context.clock(), reading)) &&
                   context.clock() < give_up_s && tracker.health().phase != TrackerPhase::failed) {
                bell.wait(0.05);
            }
            now_s = context.clock();
            if (!fresh) {
                const TrackerHealth health = tracker.health();
                return Error{health.message.empty() ? "no reading came" : health.message,
                             "tracker " + spec, "check the device, or use --tracker mouse"};
            }
        } else {
            fresh = tracker.poll(now_s, reading);
        }
        if (fresh) engine->observe(reading, tracker.is_device());
        if (i == 0 && tracker.is_device()) {
            for (const std::string& doubt :
                 sensor_mismatch_warnings(*calibrations, tracker.health().device)) {
                std::fprintf(stderr, "sonoplay: %s\n", doubt.c_str());
            }
        }
        if (replay && static_cast<std::size_t>(i) < replay->settings.size()) {
            apply_settings_text(replay->settings[static_cast<std::size_t>(i)], settings);
        }
        const double before_s = steady_seconds();
        engine->frame(now_s, settings, pixels);
        const double after_s = steady_seconds();
        if (open.bundle.blocks && open.bundle.blocks->damaged())
            return open.bundle.blocks->status();
        stats.add((after_s - before_s) * 1e3, engine->renderer().costs());
        if (tracker.is_device()) pose_to_pixel.add((context.clock() - reading.time_s) * 1e3);
        if (session) session->observe(engine->last(), pixels, !tracker.is_device());
        if (server) {
            serve_frame(*server, engine->last(), engine->renderer().layout(), render.width_px,
                        render.height_px, unix_seconds(), pixels);
            // Guests follow in real time; without them a headless run is as fast as it can be.
            if (!tracker.is_device()) {
                std::this_thread::sleep_for(std::chrono::duration<double>(1 / kFrameRate));
            }
        }
        if (i == 0) stats.set_first_frame_ms((after_s - start_s) * 1e3);
        if (!arguments.out.empty()) {
            char name[32];
            std::snprintf(name, sizeof name, "/frame_%05d.png", i);
            const Status written =
                write_png(arguments.out + name, render.width_px, render.height_px, 1, pixels);
            if (!written) return written.error();
            if (has_sheet) sheet.add(i, pixels);
        }
    }
    if (has_sheet) {
        const Status written = sheet.write(arguments.out + "/contact-sheet.png");
        if (!written) return written.error();
    }
    std::string metrics;
    if (session) {
        const Result<SessionScore> score = session->finish();
        if (!score) return score.error();
        metrics = score_json(*score, exercise);
    }
    if (!arguments.stats.empty()) {
        const Status written =
            write_text_file(arguments.stats, stats.json(metrics, &pose_to_pixel));
        if (!written) return written.error();
    }
    return Done{};
}

}  // namespace sonocase::runtime
