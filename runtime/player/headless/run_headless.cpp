// SPDX-License-Identifier: Apache-2.0

#include "runtime/player/headless/run_headless.h"

#include <chrono>
#include <cstdio>
#include <memory>
#include <optional>
#include <thread>
#include <vector>

#include "formats/attempt/draw_attempt.h"
#include "formats/base/event.h"
#include "formats/bundle/attribution.h"
#include "runtime/player/headless/doppler_run.h"
#include "runtime/player/headless/frame_files.h"
#include "runtime/player/headless/truth_files.h"
#include "runtime/player/session/calibration_set.h"
#include "runtime/player/session/case_set_up.h"
#include "runtime/player/session/clock.h"
#include "runtime/player/session/frame_server.h"
#include "runtime/player/session/frame_stats.h"
#include "runtime/player/session/session_replay.h"
#include "runtime/player/session/session_run.h"
#include "runtime/player/session/text_output.h"
#include "runtime/recording/settings_text.h"

namespace sonocase::runtime {
namespace {

constexpr double kFrameRate = 30;   // per second, of scripted runs that --frames does not spread
constexpr double kDeviceWait = 10;  // seconds for the next reading of a device

void warn(const std::string& sentence) {
    std::fprintf(stderr, "sonoplay: %s\n", sentence.c_str());
}

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

// One run: set_up(), then every frame, then finish().
class HeadlessRun {
  public:
    HeadlessRun(const PlayerArguments& arguments, double start_s)
        : arguments_(arguments), start_s_(start_s) {}
    ~HeadlessRun() {
        if (tracker_) tracker_->set_wake({});  // before `reading_arrived_` is destroyed
    }
    HeadlessRun(const HeadlessRun&) = delete;
    HeadlessRun& operator=(const HeadlessRun&) = delete;

    Status set_up();
    Status render_frames();
    Status finish();

  private:
    Status set_up_case();
    Status set_up_tracker();
    Status set_up_outputs();
    // The pose of frame i, handed to the engine; now_s: when the frame is rendered.
    Status take_pose(int i, double& now_s);
    Status wait_for_reading();
    Status render(int i, double now_s);

    const PlayerArguments& arguments_;
    double start_s_;  // of the process
    SessionClock clock_;
    Event reading_arrived_;  // notified by a device's thread

    std::unique_ptr<OpenCase> open_;
    const Exercise* exercise_ = nullptr;
    std::uint64_t seed_ = 0;  // of the attempt
    Calibrations calibrations_;
    std::optional<ScanEngine> engine_;
    std::unique_ptr<Skin> skin_;
    std::string spec_;  // of the tracker
    std::unique_ptr<Tracker> tracker_;
    std::optional<SessionReplay> replay_;  // where the tracker replays a recording of ours

    int width_px_ = 0, height_px_ = 0, frames_ = 0;
    std::vector<std::uint8_t> pixels_;
    ImageSettings settings_;
    TrackerReading reading_;

    std::unique_ptr<FrameFiles> files_;    // --out
    std::unique_ptr<TruthFiles> truth_;    // --truth
    std::unique_ptr<SessionRun> session_;  // --record
    std::unique_ptr<IgtlServer> server_;   // --serve
    std::unique_ptr<PoseServer> poses_;    // --serve-poses
    std::optional<DopplerRun> doppler_;    // from the first frame of a Doppler mode on
    FrameStats stats_;
    TimeHistogram pose_to_pixel_;
};

Status HeadlessRun::set_up() {
    for (const auto step :
         {&HeadlessRun::set_up_case, &HeadlessRun::set_up_tracker, &HeadlessRun::set_up_outputs}) {
        if (Status done = (this->*step)(); !done) return done;
    }
    return Done{};
}

Status HeadlessRun::set_up_case() {
    Result<std::unique_ptr<OpenCase>> opened = open_case_to_render(arguments_.bundle);
    if (!opened) return opened.error();
    open_ = std::move(*opened);
    for (const std::string& warning : open_->warnings) warn(warning);
    const Result<int> index = choose_or_load_exercise(*open_, arguments_.exercise);
    if (!index) return index.error();
    Exercise& exercise = open_->exercises[static_cast<std::size_t>(*index)];
    exercise_ = &exercise;
    // A replayed session brings its targets and the console's settings along.
    if (arguments_.tracker.compare(0, 7, "replay:") == 0)
        replay_ = session_replay(arguments_.tracker.substr(7));
    seed_ = arguments_.attempt_seed >= 0 ? static_cast<std::uint64_t>(arguments_.attempt_seed)
            : replay_ && replay_->header.exercise == exercise.name ? attempt_seed(replay_->header)
                                                                   : 0;
    AttemptDraw drawn =
        draw_attempt(exercise, CaseAnatomy(open_->bundle), open_->bundle->labels, seed_);
    exercise = std::move(drawn.exercise);
    for (const std::string& warning : drawn.warnings) warn(warning);
    const Result<Calibrations> calibrations = load_calibrations(arguments_.calibrations);
    if (!calibrations) return calibrations.error();
    calibrations_ = *calibrations;
    for (const std::string& warning : calibration_warnings(calibrations_, "", utc_now()))
        warn(warning);

    const ImageChoice image = initial_image(arguments_, *exercise_);
    width_px_ = image.width_px;
    height_px_ = image.height_px;
    pixels_.resize(static_cast<std::size_t>(width_px_) * height_px_);
    Result<ScanEngine> engine = make_engine(*open_, *exercise_, arguments_, image);
    if (!engine) return engine.error();
    engine_.emplace(std::move(*engine));
    engine_->set_calibrations(calibrations_);
    settings_.press_mm =
        arguments_.press_mm >= 0 ? arguments_.press_mm : exercise_->deformation.press_offset_mm;
    settings_.doppler = arguments_.doppler;
    stats_.set_effects(engine_->renderer().costs());
    return Done{};
}

Status HeadlessRun::set_up_tracker() {
    skin_ = std::make_unique<Skin>(*open_->bundle);
    clock_ = session_clock(steady_seconds());
    spec_ = arguments_.tracker;
    if (spec_.empty()) spec_ = exercise_->sweeps.empty() ? "null" : "sweep";
    Result<std::unique_ptr<Tracker>> made =
        make_case_tracker(spec_, *skin_, *exercise_, calibrations_, clock_);
    if (!made) return made.error();
    tracker_ = std::move(*made);
    tracker_->set_wake([this] { reading_arrived_.notify(); });
    frames_ = frame_count(arguments_, *tracker_);
    return Done{};
}

Status HeadlessRun::set_up_outputs() {
    if (!arguments_.out.empty()) {
        auto files = FrameFiles::in(arguments_.out);
        if (!files) return files.error();
        files_ = std::move(*files);
        files_->set_copyright(attribution_of(*open_->bundle));
        files_->begin(frames_, width_px_, height_px_);
    }
    if (!arguments_.truth.empty()) {
        auto truth = TruthFiles::in(arguments_.truth, open_->bundle, *engine_);
        if (!truth) return truth.error();
        truth_ = std::move(*truth);
    }
    if (!arguments_.record.empty()) {
        auto session = SessionRun::start(arguments_.record, *open_, *engine_, arguments_.trainee,
                                         utc_now(), 0, seed_);
        if (!session) return session.error();
        session_ = std::move(*session);
    }
    if (!arguments_.serve.empty()) {
        auto server = IgtlServer::start(arguments_.serve);
        if (!server) return server.error();
        server_ = std::move(*server);
    }
    if (!arguments_.serve_poses.empty()) {
        auto server = PoseServer::start(arguments_.serve_poses);
        if (!server) return server.error();
        poses_ = std::move(*server);
        std::printf("poses for pages: %s\n", poses_->url().c_str());
        std::fflush(stdout);
    }
    return Done{};
}

// Waits until the device has a reading newer than the last one.
Status HeadlessRun::wait_for_reading() {
    const double give_up_s = clock_() + kDeviceWait;
    while (!tracker_->poll(clock_(), reading_)) {
        if (clock_() >= give_up_s || tracker_->health().phase == TrackerPhase::failed) {
            const TrackerHealth health = tracker_->health();
            return Error{health.message.empty() ? "no reading came" : health.message,
                         "tracker " + spec_, "check the device, or use --tracker mouse"};
        }
        reading_arrived_.wait(0.05);
    }
    return Done{};
}

Status HeadlessRun::take_pose(int i, double& now_s) {
    const bool device = tracker_->is_device();
    bool fresh = true;
    if (device) {  // live input has its own clock
        if (Status came = wait_for_reading(); !came) return came;
        now_s = clock_();
    } else {
        now_s = frame_time_s(*tracker_, i, frames_);
        fresh = tracker_->poll(now_s, reading_);
    }
    if (fresh) engine_->observe(reading_, device);
    if (i == 0 && device) {
        for (const std::string& warning :
             sensor_mismatch_warnings(calibrations_, tracker_->health().device))
            warn(warning);
    }
    return Done{};
}

Status HeadlessRun::render(int i, double now_s) {
    const bool device = tracker_->is_device();
    if (replay_ && static_cast<std::size_t>(i) < replay_->settings.size())
        apply_settings_text(replay_->settings[static_cast<std::size_t>(i)], settings_);
    if (settings_.doppler.mode != DopplerMode::off && !doppler_) {
        auto run = DopplerRun::create(open_->bundle, *engine_);
        if (!run) return run.error();
        doppler_.emplace(std::move(*run));
        if (!doppler_->has_flow() && settings_.doppler.mode != DopplerMode::m_mode)
            warn("The bundle has no flow, so that Doppler modes show none; cook the case again.");
        if (!replay_)
            doppler_->aim(tool_poses(reading_, calibrations_, {}).mannequin_from_probe,
                          {!arguments_.box_given, !arguments_.gate_given, !arguments_.angle_given,
                           !arguments_.steer_given},
                          settings_.doppler);
    }
    const double before_s = steady_seconds();
    const FrameStatus status = engine_->frame(now_s, settings_, pixels_);
    const double after_s = steady_seconds();
    if (Status read = bundle_health(*open_); !read) return read;
    stats_.add((after_s - before_s) * 1e3, engine_->renderer().costs());
    stats_.count_unfitted(engine_->last().skin_not_fitted);
    stats_.set_press(engine_->renderer().press());
    if (device) pose_to_pixel_.add((clock_() - reading_.time_s) * 1e3);
    if (doppler_) doppler_->frame(*engine_, pixels_);
    if (session_) {
        FrameRecord record = engine_->last();
        if (doppler_) record.doppler = doppler_->report();
        session_->observe(record, pixels_, !device);
    }
    if (server_) {
        serve_frame(*server_, engine_->last(), engine_->renderer().layout(), width_px_, height_px_,
                    unix_seconds(), pixels_);
    }
    if (poses_) serve_poses(*poses_, engine_->last());
    if (server_ || poses_) {
        // Clients follow in real time; without them a headless run is as fast as it can be.
        if (!device) std::this_thread::sleep_for(std::chrono::duration<double>(1 / kFrameRate));
    }
    if (i == 0) stats_.set_first_frame_ms((after_s - start_s_) * 1e3);
    if (truth_) {
        double ms = 0;
        if (Status added = truth_->add(i, engine_->last().input, status, ms); !added) return added;
        stats_.add_truth(ms);
    }
    if (!files_) return Done{};
    const std::string caption =
        FrameFiles::caption(now_s, engine_->last().input.mannequin_from_probe);
    if (settings_.doppler.mode == DopplerMode::off) return files_->add(i, pixels_, caption);
    return files_->add_colour(i, pixels_, doppler_->picture(pixels_, width_px_, height_px_),
                              caption);
}

Status HeadlessRun::render_frames() {
    for (int i = 0; i < frames_; ++i) {
        double now_s = 0;
        if (Status done = take_pose(i, now_s); !done) return done;
        if (Status done = render(i, now_s); !done) return done;
    }
    return Done{};
}

Status HeadlessRun::finish() {
    if (files_) {
        const Renderer::Layout layout = engine_->renderer().layout();
        const FrameFiles::About about{open_->bundle->manifest.case_name,
                                      exercise_->name,
                                      "sonoplay",
                                      layout.mm_per_px,
                                      layout.origin_x_px,
                                      layout.origin_y_px,
                                      kFrameRate};
        if (Status written = files_->finish(about); !written) return written;
    }
    if (truth_) {
        if (Status written = truth_->finish(); !written) return written;
    }
    std::string metrics;
    if (session_) {
        const Result<SessionScore> score = session_->finish();
        if (!score) return score.error();
        metrics = score_json(*score, *exercise_);
    }
    if (doppler_ && !arguments_.sound.empty()) {
        if (Status written = doppler_->write_sound(arguments_.sound); !written) return written;
    }
    if (arguments_.stats.empty()) return Done{};
    const std::string doppler = doppler_ ? doppler_->json() : std::string();
    return write_text_output(arguments_.stats, stats_.json(metrics, &pose_to_pixel_, doppler));
}

}  // namespace

Status run_headless(const PlayerArguments& arguments, double start_s) {
    if (arguments.bundle.empty()) {
        return Error{"no bundle given", "", "sonoplay BUNDLE --headless needs one"};
    }
    HeadlessRun run(arguments, start_s);
    if (Status done = run.set_up(); !done) return done;
    if (Status done = run.render_frames(); !done) return done;
    return run.finish();
}

}  // namespace sonocase::runtime
