// SPDX-License-Identifier: Apache-2.0

#include "runtime/player/app/scan_thread.h"

#include <algorithm>
#include <chrono>
#include <utility>

#include "runtime/imaging/doppler/doppler_picture.h"

namespace sonocase::runtime::inline player_app {

void DopplerFrames::add(const ScanEngine& engine, bool live, ScanFrame& out) {
    DopplerFrame& to = out.doppler;
    const FrameInput& input = out.record.input;
    const DopplerMode mode = view_ ? input.settings.doppler.mode : DopplerMode::off;
    to.mode = mode;
    to.has_flow = view_ && view_->has_flow();
    const bool box = mode == DopplerMode::colour || mode == DopplerMode::power;
    const bool strip = mode == DopplerMode::spectral || mode == DopplerMode::m_mode;
    if (!box) to.rgb.clear();
    if (!strip) to.strip.clear();
    if (live) live_mode_ = mode;
    if (mode == DopplerMode::off) return;
    // A strip runs on with the time of live frames; going back would begin it anew.
    if (live || box) view_->frame(input, engine.renderer(), out.pixels);
    if (live) out.record.doppler = view_->report();  // for scores
    if (box) {
        to.colour = view_->colour();
        to.rgb.resize(3 * out.pixels.size());
        doppler::compose(out.pixels, view_->overlay(), mode, to.rgb);
        return;
    }
    to.strip.assign(static_cast<std::size_t>(kStripWidth) * kStripHeight, 0);
    if (mode == DopplerMode::spectral) {
        doppler::draw_spectrum(view_->spectrum(), kStripSeconds, kStripWidth, kStripHeight,
                               to.strip);
        to.measures = view_->spectrum().measures();
        to.gate = view_->spectrum().gate();
    } else {
        doppler::draw_m_mode(view_->m_mode(), kStripWidth, kStripHeight, to.strip);
    }
}

std::span<const float> DopplerFrames::sound() const {
    if (!view_ || live_mode_ != DopplerMode::spectral) return {};
    return view_->spectrum().sound();
}

namespace {

constexpr double kRestingWait = 0.25;  // s; what wakes the thread wakes it at once

}  // namespace

ScanThread::ScanThread(SessionClock clock) : clock_(std::move(clock)) {
    cine_.resize(kCineSeconds * kCineRate);
    thread_ = std::thread([this] { run(); });
}

ScanThread::~ScanThread() {
    {
        const std::lock_guard lock(mutex_);
        if (tracker_) tracker_->set_wake({});
    }
    {
        const std::lock_guard lock(wake_mutex_);
        stop_ = true;
    }
    wake_condition_.notify_one();
    thread_.join();
}

void ScanThread::wake() {
    {
        const std::lock_guard lock(wake_mutex_);
        work_ = true;
    }
    wake_condition_.notify_one();
}

bool ScanThread::with_engine(const std::function<void(ScanEngine&)>& use) {
    const std::lock_guard lock(mutex_);
    if (engine_) use(*engine_);
    return engine_ != nullptr;
}

void ScanThread::set_engine(std::unique_ptr<ScanEngine> engine,
                            bool keep_session,
                            std::unique_ptr<DopplerView> doppler) {
    {
        const std::lock_guard lock(mutex_);
        doppler_.set_view(std::move(doppler));
        if (engine && engine_ && keep_session) engine->take_over(*engine_);
        std::swap(engine_, engine);
        if (engine_) {
            engine_->set_calibrations(calibrations_);
            engine_->set_assignment(controls_.assignment);
            if (reading_.sequence > 0) {
                engine_->observe(reading_, tracker_ && tracker_->is_device());
            }
            stats_.set_effects(engine_->renderer().costs());
        }
        cine_count_ = 0;
        redraw_ = true;
    }
    wake();
}

void ScanThread::set_tracker(std::shared_ptr<Tracker> tracker) {
    {
        const std::lock_guard lock(mutex_);
        if (tracker_) tracker_->set_wake({});
        tracker_ = std::move(tracker);
        // What the tracker before it reported is not this one's.
        reading_ = {};
        waiting_ = tracker_ != nullptr;
        redraw_ = true;
        if (tracker_) tracker_->set_wake([this] { wake(); });
    }
    wake();
}

void ScanThread::set_doppler(std::unique_ptr<DopplerView> doppler) {
    const std::lock_guard lock(mutex_);
    doppler_.set_view(std::move(doppler));
}

void ScanThread::set_sound(SoundSink sink) {
    const std::lock_guard lock(mutex_);
    sound_ = std::move(sink);
}

void ScanThread::set_tools(const ToolNames& tools) {
    const std::lock_guard lock(mutex_);
    if (tracker_) tracker_->set_tools(tools);
}

void ScanThread::set_calibrations(const Calibrations& calibrations) {
    const std::lock_guard lock(mutex_);
    calibrations_ = calibrations;
    if (engine_) engine_->set_calibrations(calibrations);
}

void ScanThread::set_observer(FrameObserver observer, bool unseen) {
    const std::lock_guard lock(mutex_);
    observer_ = std::move(observer);
    observes_unseen_ = unseen && observer_;
}

void ScanThread::set_controls(const ScanControls& controls) {
    controls_box_.publish(controls);
    ++controls_set_;
    wake();
}

TrackerHealth ScanThread::tracker_health() const {
    std::shared_ptr<Tracker> tracker;
    {
        const std::lock_guard lock(mutex_);
        tracker = tracker_;
    }
    return tracker ? tracker->health() : TrackerHealth{};
}

std::string ScanThread::stats_json(const std::string& score_json,
                                   const std::string& window_json) const {
    const std::lock_guard lock(mutex_);
    return stats_.json(score_json, &pose_to_pixel_, window_json);
}

void ScanThread::run() {
    using namespace std::chrono;
    for (;;) {
        const bool rendered = step();
        std::unique_lock lock(wake_mutex_);
        if (stop_) return;
        // A script is a function of time and always has a new pose: it is polled at the idle rate,
        // like breathing and noise. Without an engine, or while nothing is to be rendered, there is
        // nothing to be in time for.
        double wait_s =
            rendered ? 1 / kIdleRate
            : resting_ && !observes_unseen_
                ? kRestingWait
                : std::clamp(std::max(last_frame_s_, last_unseen_s_) + 1 / kIdleRate - clock_(),
                             5e-4, 0.1);
        // A recording is polled when its next reading is due.
        if (next_reading_s_ >= 0) wait_s = std::clamp(next_reading_s_ - clock_(), 0.0, wait_s);
        wake_condition_.wait_for(lock, duration<double>(wait_s), [this] { return work_ || stop_; });
        work_ = false;
        if (stop_) return;
    }
}

void ScanThread::take_controls() {
    if (!controls_box_.refresh()) return;
    const ScanControls& wanted = controls_box_.value();
    redraw_ = redraw_ || wanted.frozen != controls_.frozen ||
              (wanted.frozen &&
               (wanted.cine_back != controls_.cine_back || wanted.settings != controls_.settings));
    if (engine_ && !(wanted.assignment == controls_.assignment)) {
        engine_->set_assignment(wanted.assignment);
    }
    controls_ = wanted;
}

bool ScanThread::poll_tracker(double now_s) {
    next_reading_s_ = -1;
    if (!tracker_) return false;
    TrackerReading reading;
    const bool arrived = tracker_->poll(now_s, reading);
    next_reading_s_ = tracker_->next_s();
    if (arrived) {
        waiting_ = false;
        reading_ = reading;
        engine_->observe(reading_, tracker_->is_device());
        if (reading_.restarts) engine_->pass_over(tracker_->passed_over());
        // Another engine is given this reading again, not what was done with it.
        reading_.restarts = false;
        reading_.acts = {};
    }
    return arrived;
}

// An attempt goes on behind a frozen picture: tools move and act, and nobody sees them.
void ScanThread::observe_unseen(double now_s) {
    last_unseen_s_ = now_s;
    const RenderOptions& options = engine_->render_options();
    unseen_.width_px = options.width_px;
    unseen_.height_px = options.height_px;
    unseen_.pixels.resize(static_cast<std::size_t>(options.width_px) * options.height_px);
    unseen_.status = engine_->frame(now_s, controls_.settings, unseen_.pixels, true);
    unseen_.record = engine_->last();
    unseen_.layout = engine_->renderer().layout();
    if (waiting_) {
        unseen_.record.tools = {};
        unseen_.record.needle = {};
    }
    observer_(unseen_);
    // The card shows what was done.
    const FrameRecord& record = unseen_.record;
    redraw_ = redraw_ || record.acts.count > 0 || record.new_steps != 0;
}

// A frozen picture is rendered again from its record.
void ScanThread::render_kept(ScanFrame& out) {
    const std::size_t back =
        std::min<std::size_t>(std::max(controls_.cine_back, 0), cine_count_ - 1);
    const std::size_t size = cine_.size();
    const FrameRecord& newest = cine_[(cine_next_ + size - 1) % size];
    FrameRecord shown = cine_[(cine_next_ + 2 * size - 1 - back) % size];
    out.cine_back = static_cast<int>(back);
    out.cine_age_s = newest.input.time_s - shown.input.time_s;
    shown.input.settings = controls_.settings;  // gain and TGC still work on a frozen picture
    out.record = shown;
    out.status = engine_->frame_again(shown, out.pixels);
}

void ScanThread::describe(ScanFrame& out, double now_s) const {
    out.frozen = controls_.frozen;
    out.waiting = waiting_ && !controls_.frozen;
    out.reading = reading_;
    if (engine_->procedure().given()) out.procedure = engine_->procedure().view();
    out.layout = engine_->renderer().layout();
    out.gain_law = engine_->renderer().gain_law();
    out.depth_mm = engine_->exercise().probe.depth_mm;
    out.focus_mm = engine_->exercise().probe.focus_mm;
    out.accuracy = engine_->renderer().accuracy();
    const auto costs = engine_->renderer().costs();
    out.cost_count = static_cast<int>(std::min<std::size_t>(costs.size(), kMaxEffects));
    std::copy_n(costs.begin(), out.cost_count, out.costs.begin());
    out.probe_verdict = waiting_ ? SensorVerdict::absent : engine_->probe_verdict(now_s);
    out.needle_verdict = waiting_ ? SensorVerdict::absent : engine_->needle_verdict(now_s);
    out.reference_verdict = waiting_ ? SensorVerdict::absent : engine_->reference_verdict(now_s);
}

// Statistics and cine loop of a live frame. arrived: with a new reading.
void ScanThread::count_live(const ScanFrame& out, double now_s, bool arrived) {
    stats_.add(out.frame_ms, engine_->renderer().costs());
    stats_.set_accuracy(out.accuracy);
    stats_.count_unfitted(out.record.skin_not_fitted);
    stats_.set_press(out.record.press);
    if (arrived) pose_to_pixel_.add((out.rendered_s - reading_.time_s) * 1e3);
    if (last_frame_s_ >= 0 && now_s > last_frame_s_) {
        rate_ += 0.1 * (1 / (now_s - last_frame_s_) - rate_);
    }
    if (now_s - cine_last_s_ >= 0.98 / kCineRate) {
        cine_[cine_next_] = out.record;
        cine_next_ = (cine_next_ + 1) % cine_.size();
        cine_count_ = std::min(cine_count_ + 1, cine_.size());
        cine_last_s_ = now_s;
    }
    last_frame_s_ = now_s;
}

bool ScanThread::step() {
    const std::lock_guard lock(mutex_);
    const std::uint64_t set = controls_set_;
    take_controls();
    resting_ = !engine_ || controls_.frozen || controls_.resting;
    const bool rendered = engine_ && render(clock_());
    if (rendered || resting_) controls_shown_ = set;
    return rendered;
}

bool ScanThread::render(double now_s) {
    const bool arrived = poll_tracker(now_s);
    if (controls_.frozen && cine_count_ > 0 && observes_unseen_ &&
        (arrived || now_s - last_unseen_s_ >= 0.98 / kIdleRate))
        observe_unseen(now_s);
    if (controls_.frozen && !redraw_) return false;
    if (controls_.resting && !arrived && !redraw_) return false;
    if (!controls_.frozen && !arrived && !redraw_ && now_s - last_frame_s_ < 0.98 / kIdleRate) {
        return false;
    }
    redraw_ = false;

    ScanFrame& out = frames_.slot();
    const RenderOptions& options = engine_->render_options();
    out.width_px = options.width_px;
    out.height_px = options.height_px;
    out.pixels.resize(static_cast<std::size_t>(options.width_px) * options.height_px);
    out.cine_age_s = 0;
    out.cine_back = 0;
    const bool live = !controls_.frozen || cine_count_ == 0;
    const double before_s = clock_();
    if (live) {
        out.status = engine_->frame(now_s, controls_.settings, out.pixels);
        out.record = engine_->last();
        if (waiting_) {
            std::fill(out.pixels.begin(), out.pixels.end(), std::uint8_t{0});
            out.record.tools = {};
            out.record.needle = {};
        }
    } else {
        render_kept(out);
    }
    doppler_.add(*engine_, live, out);
    if (live && sound_ && controls_.sound) sound_(doppler_.sound(), doppler_.sound_hz());
    out.rendered_s = clock_();
    out.frame_ms = (out.rendered_s - before_s) * 1e3;
    describe(out, now_s);
    if (live) count_live(out, now_s, arrived);
    out.cine_frames = static_cast<int>(cine_count_);
    out.frames_per_s = rate_;
    // Quantiles walk through a histogram: once every ten frames is enough for a display.
    if (number_ % 10 == 0) {
        median_ms_ = pose_to_pixel_.quantile(0.5);
        p99_ms_ = pose_to_pixel_.quantile(0.99);
    }
    out.pose_to_pixel_median_ms = median_ms_;
    out.pose_to_pixel_p99_ms = p99_ms_;
    if (number_ == 0 && start_s_) stats_.set_first_frame_ms((out.rendered_s - *start_s_) * 1e3);
    out.number = ++number_;
    if (observer_ && live) observer_(out);
    frames_.publish();
    return true;
}

}  // namespace sonocase::runtime::inline player_app
