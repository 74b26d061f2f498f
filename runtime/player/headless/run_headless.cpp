// SPDX-License-Identifier: Apache-2.0

// A run without a window, and its Doppler modes: pictures, measures and sound.

#include "runtime/player/headless/run_headless.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <cstring>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <thread>
#include <vector>

#include <nlohmann/json.hpp>

#include "formats/base/mailbox.h"
#include "formats/base/result.h"
#include "formats/bundle/case_bundle.h"
#include "formats/files/atomic_file.h"
#include "formats/scoring/draw_attempt.h"
#include "runtime/engine/scan_engine.h"
#include "runtime/imaging/doppler/doppler_picture.h"
#include "runtime/imaging/doppler/doppler_view.h"
#include "runtime/player/headless/frame_files.h"
#include "runtime/player/headless/truth_files.h"
#include "runtime/player/session/calibration_set.h"
#include "runtime/player/session/clock.h"
#include "runtime/player/session/effect_trials.h"
#include "runtime/player/session/frame_server.h"
#include "runtime/player/session/frame_stats.h"
#include "runtime/player/session/open_case.h"
#include "runtime/player/session/session_run.h"
#include "runtime/recording/session_words.h"
#include "runtime/tracking/devices/make_tracker.h"

namespace sonocase::runtime::inline player_headless {

class DopplerRun {
  public:
    // Errors: those of DopplerView::create. The case must outlive the run.
    static Result<DopplerRun> create(CaseView bundle, const ScanEngine& engine);

    bool has_flow() const { return view_.has_flow(); }
    // Box, and gate with its cursor, in the widest vessel of the plane; lines are steered towards
    // its flow.
    struct Aim {
        bool box = true, gate = true, cursor = true, steering = true, scale = true;
    };
    void aim(const Rigid& mannequin_from_probe, Aim what, DopplerSettings& settings) const;
    // What the recording keeps of the last frame.
    DopplerReport report() const { return view_.report(); }
    // The Doppler picture of the frame that the engine rendered last.
    void frame(const ScanEngine& engine, std::span<const std::uint8_t> pixels);

    // The picture in colour with its overlay, or with the strip of spectrum or M-mode below it.
    std::span<const std::uint8_t> picture(std::span<const std::uint8_t> pixels,
                                          int width,
                                          int height);
    // {"doppler": {...}}: psv_cm_s, edv_cm_s, mean_cm_s, flow_ml_min and what they were measured
    // with; shown cells and frame rate of a colour box; ms a frame.
    std::string json() const;
    // Error: no spectrum was made, or the file cannot be written.
    Status write_sound(const std::string& path) const;

  private:
    explicit DopplerRun(DopplerView view) : view_(std::move(view)) {}

    DopplerView view_;
    DopplerMode mode_ = DopplerMode::off;
    std::vector<std::uint8_t> rgb_;
    std::vector<float> sound_;
    double sound_hz_ = 0, ms_ = 0, shown_cells_ = 0;
    int frames_ = 0;
};

namespace {

double rounded(double value) {
    return std::round(value * 1e4) / 1e4;
}

template <class T>
void put(std::vector<std::uint8_t>& bytes, T value) {
    const std::size_t at = bytes.size();
    bytes.resize(at + sizeof value);
    std::memcpy(bytes.data() + at, &value, sizeof value);
}

void put(std::vector<std::uint8_t>& bytes, const char* text) {
    bytes.insert(bytes.end(), text, text + 4);
}

// RIFF, 16 bits, two channels.
std::vector<std::uint8_t> wav_of(std::span<const float> pairs, double hz) {
    float loudest = 1e-9f;
    for (const float v : pairs) loudest = std::max(loudest, std::abs(v));
    const auto data = static_cast<std::uint32_t>(2 * pairs.size());
    const auto rate = static_cast<std::uint32_t>(std::lround(hz));
    std::vector<std::uint8_t> bytes;
    put(bytes, "RIFF");
    put(bytes, std::uint32_t{36} + data);
    put(bytes, "WAVE");
    put(bytes, "fmt ");
    put(bytes, std::uint32_t{16});
    put(bytes, std::uint16_t{1});
    put(bytes, std::uint16_t{2});
    put(bytes, rate);
    put(bytes, 4 * rate);
    put(bytes, std::uint16_t{4});
    put(bytes, std::uint16_t{16});
    put(bytes, "data");
    put(bytes, data);
    for (const float v : pairs)
        put(bytes, static_cast<std::int16_t>(std::lround(32000 * v / loudest)));
    return bytes;
}

}  // namespace

Result<DopplerRun> DopplerRun::create(CaseView bundle, const ScanEngine& engine) {
    SONOCASE_TRY(auto view,
                 DopplerView::create(bundle, engine.exercise(), engine.render_options()));
    return DopplerRun(std::move(view));
}

void DopplerRun::aim(const Rigid& mannequin_from_probe, Aim what, DopplerSettings& settings) const {
    FrameInput input;
    input.mannequin_from_probe = mannequin_from_probe;
    const DopplerSettings aimed = view_.aimed(input, settings, what.steering);
    settings.steer_deg = aimed.steer_deg;
    if (what.box) {
        settings.box_left = aimed.box_left;
        settings.box_right = aimed.box_right;
        settings.box_top_mm = aimed.box_top_mm;
        settings.box_bottom_mm = aimed.box_bottom_mm;
    }
    if (what.gate) {
        settings.gate_line = aimed.gate_line;
        settings.gate_depth_mm = aimed.gate_depth_mm;
        settings.gate_mm = aimed.gate_mm;
    }
    if (what.gate && what.cursor) settings.angle_deg = aimed.angle_deg;
    if (what.gate && what.scale) settings.spectral_scale_cm_s = aimed.spectral_scale_cm_s;
}

void DopplerRun::frame(const ScanEngine& engine, std::span<const std::uint8_t> pixels) {
    const FrameInput& input = engine.last().input;
    mode_ = input.settings.doppler.mode;
    if (mode_ == DopplerMode::off) return;
    const double before_s = steady_seconds();
    view_.frame(input, engine.renderer(), pixels);
    ms_ += (steady_seconds() - before_s) * 1e3;
    ++frames_;
    if (mode_ == DopplerMode::spectral) {
        const auto sound = view_.spectrum().sound();
        sound_.insert(sound_.end(), sound.begin(), sound.end());
        sound_hz_ = view_.spectrum().sound_hz();
    } else {
        shown_cells_ += view_.colour().shown_cells;
    }
}

std::span<const std::uint8_t> DopplerRun::picture(std::span<const std::uint8_t> pixels,
                                                  int width,
                                                  int height) {
    rgb_.resize(3 * static_cast<std::size_t>(width) * doppler_rows(mode_, height));
    draw_doppler(view_, mode_, pixels, width, height, rgb_);
    return rgb_;
}

std::string DopplerRun::json() const {
    nlohmann::ordered_json out;
    auto& d = out["doppler"];
    d["ms"] = rounded(frames_ > 0 ? ms_ / frames_ : 0);
    if (mode_ == DopplerMode::spectral) {
        const doppler::SpectralMeasures m = view_.spectrum().measures();
        const doppler::GateContent& gate = view_.spectrum().gate();
        d["beats"] = m.beats;
        d["psv_cm_s"] = rounded(m.psv_cm_s);
        d["psv_raw_cm_s"] = rounded(m.psv_raw_cm_s);
        d["true_psv_cm_s"] = rounded(m.true_psv_cm_s);
        d["edv_cm_s"] = rounded(m.edv_cm_s);
        d["mean_cm_s"] = rounded(m.mean_cm_s);
        d["resistive_index"] = rounded(m.resistive_index);
        d["flow_ml_min"] = rounded(m.flow_ml_min);
        d["flow_true_area_ml_min"] = rounded(m.flow_true_area_ml_min);
        d["diameter_mm"] = rounded(m.diameter_mm);
        d["true_angle_deg"] = rounded(gate.angle_deg);
        d["gate_spans_vessel"] = gate.spans;
        d["gate_in_two_vessels"] = gate.two_vessels;
    } else if (mode_ == DopplerMode::colour || mode_ == DopplerMode::power) {
        const doppler::ColourReport& report = view_.colour();
        d["cells"] = report.cells;
        d["blood_cells"] = report.blood_cells;
        d["shown_cells_mean"] = rounded(frames_ > 0 ? shown_cells_ / frames_ : 0);
        d["flash"] = report.flash;
        d["machine_frames_per_s"] = rounded(report.frame_hz);
    }
    return out.dump();
}

Status DopplerRun::write_sound(const std::string& path) const {
    if (sound_.empty())
        return Error{"no spectrum was made, so that there is no sound", path,
                     "use --sound with --mode pw"};
    return write_file(path, wav_of(sound_, sound_hz_));
}

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
    // Prints what the tracker has to say, once per sentence.
    void say_health();
    // What a device did not give in all those frames.
    Status report_lost();
    Status render(int i, double now_s);

    const PlayerArguments& arguments_;
    double start_s_;  // of the process
    SessionClock clock_;
    Event reading_arrived_;  // notified by a device's thread

    std::unique_ptr<OpenCase> open_;
    const Exercise* exercise_ = nullptr;
    std::uint64_t seed_ = 0;  // of the attempt
    Calibrations calibrations_;
    SensorAssignment assignment_;
    std::optional<ScanEngine> engine_;
    std::unique_ptr<Skin> skin_;
    std::string spec_;  // of the tracker
    std::unique_ptr<Tracker> tracker_;
    std::optional<SessionReplay> replay_;  // where the tracker replays a recording of ours

    int width_px_ = 0, height_px_ = 0, frames_ = 0;
    std::vector<std::uint8_t> pixels_;
    ImageSettings settings_;
    TrackerReading reading_;
    std::string said_;          // format of the tracker's last sentence
    bool heard_cause_ = false;  // it was printed: more than that the tracker begins
    struct LostFrames {
        int frames = 0, seen = 0;  // lost since it was seen first; seen
        double seconds = 0;
    } probe_lost_, needle_lost_;
    double last_frame_s_ = 0;

    std::unique_ptr<FrameFiles> files_;    // --out
    std::unique_ptr<TruthFiles> truth_;    // --truth
    std::unique_ptr<SessionRun> session_;  // --record
    std::unique_ptr<IgtlServer> server_;   // --serve
    std::unique_ptr<PoseServer> poses_;    // --serve-poses
    std::optional<DopplerRun> doppler_;    // from the first frame of a Doppler mode on
    std::vector<FrameInput> inputs_;       // of the run's frames; with --measure-effects
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
    SONOCASE_TRY(std::unique_ptr<OpenCase> opened, open_case_to_render(arguments_.bundle));
    open_ = std::move(opened);
    for (const std::string& warning : open_->warnings) warn(warning);
    SONOCASE_TRY(const int index, choose_or_load_exercise(*open_, arguments_.exercise));
    Exercise& exercise = open_->exercises[index];
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
    SONOCASE_TRY(const Calibrations calibrations, load_calibrations(arguments_.calibrations));
    calibrations_ = calibrations;
    for (const std::string& warning : calibration_warnings(calibrations_, "", utc_now()))
        warn(warning);

    const ImageChoice image = initial_image(arguments_, *exercise_);
    width_px_ = image.width_px;
    height_px_ = image.height_px;
    pixels_.resize(static_cast<std::size_t>(width_px_) * height_px_);
    SONOCASE_TRY(ScanEngine engine, make_engine(*open_, *exercise_, arguments_, image));
    engine_.emplace(std::move(engine));
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
    SONOCASE_TRY(
        std::unique_ptr<Tracker> made,
        make_case_tracker(spec_, *skin_, *exercise_, calibrations_, arguments_.tools, clock_));
    tracker_ = std::move(made);
    SONOCASE_TRY(const ToolNames tools, parse_tool_names(arguments_.tools));
    assignment_ = assignment_of(tools, {});
    engine_->set_assignment(assignment_);
    tracker_->set_wake([this] { reading_arrived_.notify(); });
    frames_ = frame_count(arguments_, *tracker_);
    return Done{};
}

Status HeadlessRun::set_up_outputs() {
    if (!arguments_.out.empty()) {
        SONOCASE_TRY(auto files, FrameFiles::in(arguments_.out));
        files_ = std::move(files);
        files_->set_copyright(attribution_of(*open_->bundle));
        files_->begin(frames_, width_px_, height_px_);
    }
    if (!arguments_.truth.empty()) {
        SONOCASE_TRY(auto truth, TruthFiles::in(arguments_.truth, open_->bundle, *engine_));
        truth_ = std::move(truth);
    }
    if (!arguments_.record.empty()) {
        SONOCASE_TRY(auto session, SessionRun::start(arguments_.record, *open_, *engine_,
                                                     arguments_.trainee, utc_now(), 0, seed_));
        session_ = std::move(session);
    }
    if (!arguments_.serve.empty()) {
        SONOCASE_TRY(auto server, IgtlServer::start(arguments_.serve));
        server_ = std::move(server);
    }
    if (!arguments_.serve_poses.empty()) {
        SONOCASE_TRY(auto server, PoseServer::start(arguments_.serve_poses));
        poses_ = std::move(server);
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
            // A sentence that was said as a warning names the cure itself.
            const bool explained = !health.message.empty() && health.message.format() == said_ &&
                                   health.phase != TrackerPhase::failed;
            const std::string where = "tracker " + spec_;
            if (health.message.empty())
                return Error{"no reading came", where, "check the device, or use --tracker mouse"};
            if (explained && heard_cause_) return Error{health.message, where, ""};
            return Error{Message("{} Check the device, or use --tracker mouse.", {health.message}),
                         where, ""};
        }
        say_health();
        reading_arrived_.wait(0.05);
    }
    return Done{};
}

void HeadlessRun::say_health() {
    if (!tracker_->is_device() && tracker_->recorded_readings() == 0) return;
    const TrackerHealth health = tracker_->health();
    // A search ends of itself, or with an error.
    if (health.phase == TrackerPhase::searching || health.message.empty() ||
        health.message.format() == said_)
        return;
    const bool first = said_.empty() && health.phase == TrackerPhase::starting;
    said_ = health.message.format();
    heard_cause_ = !first;
    if (!first) warn(health.message);
}

Status HeadlessRun::report_lost() {
    const auto say = [&](const char* tool, const LostFrames& lost) {
        if (lost.frames == 0) return;
        char text[200];
        std::snprintf(text, sizeof text,
                      "The %s was out of view in %d of %d frames, %.2f s; they count as untracked.",
                      tool, lost.frames, lost.frames + lost.seen, lost.seconds);
        warn(text);
    };
    say("probe", probe_lost_);
    say("needle", needle_lost_);
    if (probe_lost_.seen > 0) return Done{};
    // A run may be over before the tracker has heard enough to say why.
    constexpr double kExplained = 2.5;
    TrackerHealth health = tracker_->health();
    for (const double end_s = clock_() + kExplained; health.message.empty() && clock_() < end_s;
         health = tracker_->health())
        reading_arrived_.wait(0.05);
    return Error{
        "no frame has a pose of the probe", "tracker " + spec_,
        health.message.empty() ? Message("send one, such as ProbeToTracker") : health.message};
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
    say_health();
    if (fresh) engine_->observe(reading_, device);
    if (fresh && reading_.restarts) engine_->pass_over(tracker_->passed_over());
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
        apply_settings_text(replay_->settings[i], settings_);
    if (settings_.doppler.mode != DopplerMode::off && !doppler_) {
        SONOCASE_TRY(auto run, DopplerRun::create(open_->bundle, *engine_));
        doppler_.emplace(std::move(run));
        if (!doppler_->has_flow() && settings_.doppler.mode != DopplerMode::m_mode)
            warn("The bundle has no flow, so that Doppler modes show none; cook the case again.");
        if (!replay_)
            doppler_->aim(tool_poses(reading_, calibrations_, assignment_).mannequin_from_probe,
                          {!arguments_.box_given, !arguments_.gate_given, !arguments_.angle_given,
                           !arguments_.steer_given, !arguments_.spectral_scale_given},
                          settings_.doppler);
    }
    const double before_s = steady_seconds();
    const FrameStatus status = engine_->frame(now_s, settings_, pixels_);
    const double after_s = steady_seconds();
    if (Status read = bundle_health(*open_); !read) return read;
    stats_.add((after_s - before_s) * 1e3, engine_->renderer().costs());
    if (arguments_.measure_effects) inputs_.push_back(engine_->last().input);
    stats_.count_unfitted(engine_->last().skin_not_fitted);
    stats_.set_press(engine_->renderer().press());
    if (device) {
        pose_to_pixel_.add((clock_() - reading_.time_s) * 1e3);
        const ToolPoses& tools = engine_->last().tools;
        const auto count = [&](LostFrames& lost, bool has) {
            if (has) ++lost.seen;
            if (has || lost.seen == 0) return;
            ++lost.frames;
            lost.seconds += now_s - last_frame_s_;
        };
        count(probe_lost_, tools.has_probe);
        count(needle_lost_, tools.has_needle);
        last_frame_s_ = now_s;
    }
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
        SONOCASE_TRY(const SessionScore score, session_->finish());
        metrics = score_json(score, *exercise_);
    }
    if (doppler_ && !arguments_.sound.empty()) {
        if (Status written = doppler_->write_sound(arguments_.sound); !written) return written;
    }
    if (tracker_->is_device()) {
        if (Status seen = report_lost(); !seen) return seen;
    }
    if (arguments_.measure_effects) {
        constexpr int kTurns = 8;
        SONOCASE_TRY(auto trials, try_effects(open_->bundle, engine_->exercise(),
                                              engine_->render_options(), inputs_, kTurns));
        stats_.set_measured(std::move(trials));
    }
    if (!arguments_.stats.empty()) {
        const std::string doppler = doppler_ ? doppler_->json() : std::string();
        if (Status written =
                write_text_output(arguments_.stats, stats_.json(metrics, &pose_to_pixel_, doppler));
            !written)
            return written;
    }
    if (session_ && !session_->not_kept().empty())
        return Error{session_->not_kept(), "", "close the program that has it, or free the folder"};
    return Done{};
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

}  // namespace sonocase::runtime::inline player_headless
