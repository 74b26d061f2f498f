// SPDX-License-Identifier: Apache-2.0

// The thread that renders: the engine with its tracker, and the Doppler modes of its frames.
#pragma once

#include <atomic>
#include <condition_variable>
#include <cstdint>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <span>
#include <string>
#include <thread>
#include <vector>

#include "formats/base/mailbox.h"
#include "runtime/engine/scan_engine.h"
#include "runtime/imaging/doppler/doppler_view.h"
#include "runtime/player/session/frame_stats.h"
#include "runtime/player/session/scan_frame.h"
#include "runtime/tracking/tracker.h"

namespace sonocase::runtime::inline player_app {

class DopplerFrames {
  public:
    // view: of the engine in use; null: no mode is on.
    void set_view(std::unique_ptr<DopplerView> view) { view_ = std::move(view); }
    bool has_view() const { return view_ != nullptr; }

    // Fills out.doppler from the frame in `out`, which `engine` rendered last. live: false for a
    // frame of the cine loop, whose strip stays as it was frozen. Allocates only when a mode is
    // first shown at a picture's size.
    void add(const ScanEngine& engine, bool live, ScanFrame& out);

    // Pairs of samples (towards, away) of the live frame that was added last; empty outside the
    // spectral mode.
    std::span<const float> sound() const;
    double sound_hz() const { return view_ ? view_->spectrum().sound_hz() : 0; }

  private:
    std::unique_ptr<DopplerView> view_;
    DopplerMode live_mode_ = DopplerMode::off;
};

// The engine on a thread of its own: it renders a frame as soon as a pose arrives, and at an idle
// rate when none does, because tissue breathes and noise changes. The window takes the latest frame
// when it draws and never waits for one.

// Called on the scan thread with each live frame: recording, the exercise's metrics, streaming.
using FrameObserver = std::function<void(const ScanFrame&)>;
// Called on the scan thread with the sound of spectral Doppler: pairs of samples, and their rate.
using SoundSink = std::function<void(std::span<const float> pairs, double hz)>;

class ScanThread {
  public:
    explicit ScanThread(SessionClock clock);
    ~ScanThread();  // stops
    ScanThread(const ScanThread&) = delete;
    ScanThread& operator=(const ScanThread&) = delete;

    // Each takes effect between two frames. The bundle must outlive the engine's use: when
    // set_engine returns, the thread no longer uses the engine before it.
    // keep_session  the new engine continues the session of the engine before it
    // doppler       of that engine; null: Doppler modes show the grey picture
    void set_engine(std::unique_ptr<ScanEngine> engine,
                    bool keep_session = false,
                    std::unique_ptr<DopplerView> doppler = nullptr);
    void set_doppler(std::unique_ptr<DopplerView> doppler);
    void set_sound(SoundSink sink);
    void set_tracker(std::shared_ptr<Tracker> tracker);
    void set_tools(const ToolNames& tools);  // of the tracker in use
    void set_calibrations(const Calibrations& calibrations);
    // unseen: it is also given frames behind a frozen picture, FrameRecord::unseen.
    void set_observer(FrameObserver observer, bool unseen = false);
    // Runs `use` between two frames; false when there is no engine.
    bool with_engine(const std::function<void(ScanEngine&)>& use);
    void set_controls(const ScanControls& controls);
    // How often controls were set, and how many of these refresh() and frame() show: a picture that
    // stands still shows all that do not change it.
    std::uint64_t controls_set() const { return controls_set_; }
    std::uint64_t controls_shown() const { return controls_shown_; }

    // Window thread: true if frame() is newer than after the last call.
    bool refresh() { return frames_.refresh(); }
    const ScanFrame& frame() const { return frames_.value(); }

    TrackerHealth tracker_health() const;
    // The JSON of --stats, of all frames since the thread started.
    std::string stats_json(const std::string& score_json, const std::string& window_json) const;
    // When the program started, on the session's clock (before 0), for first_frame_ms of --stats.
    // Before the first engine.
    void set_program_start_s(double start_s) { start_s_ = start_s; }

  private:
    void run();
    // Looks for work once, under the lock; true if it rendered a frame. Its parts, in order:
    bool step();
    void take_controls();
    bool render(double now_s);        // if a frame is due
    bool poll_tracker(double now_s);  // true: a new reading
    void observe_unseen(double now_s);
    void render_kept(ScanFrame& out);
    void describe(ScanFrame& out, double now_s) const;
    void count_live(const ScanFrame& out, double now_s, bool arrived);
    void wake();

    SessionClock clock_;
    mutable std::mutex mutex_;  // engine, tracker, controls; held by the thread while it renders
    std::mutex wake_mutex_;
    std::condition_variable wake_condition_;
    bool work_ = false, stop_ = false;

    std::unique_ptr<ScanEngine> engine_;
    DopplerFrames doppler_;
    std::shared_ptr<Tracker> tracker_;
    Calibrations calibrations_;
    FrameObserver observer_;
    bool observes_unseen_ = false;
    ScanFrame unseen_;  // behind a frozen picture
    double last_unseen_s_ = -1;
    SoundSink sound_;
    Mailbox<ScanControls> controls_box_;
    ScanControls controls_;
    std::atomic<std::uint64_t> controls_set_ = 0, controls_shown_ = 0;
    bool redraw_ = false;
    bool resting_ = true;   // nothing is rendered until something wakes the thread
    bool waiting_ = false;  // for the tracker's first reading

    std::vector<FrameRecord> cine_;  // ring
    std::size_t cine_next_ = 0, cine_count_ = 0;
    double cine_last_s_ = -1, last_frame_s_ = -1;
    TrackerReading reading_;
    FrameStats stats_;
    TimeHistogram pose_to_pixel_;
    double next_reading_s_ = -1;  // of a recording
    double rate_ = 0, median_ms_ = 0, p99_ms_ = 0;
    std::uint64_t number_ = 0;
    std::optional<double> start_s_;
    Mailbox<ScanFrame> frames_;
    std::thread thread_;
};

}  // namespace sonocase::runtime::inline player_app
