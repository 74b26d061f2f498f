// SPDX-License-Identifier: Apache-2.0

// The engine on a thread of its own: a frame is rendered as soon as a pose arrives, and at an idle
// rate when none does, because tissue breathes and noise lives. The window takes the latest frame
// when it draws and never waits for one.
#pragma once

#include <array>
#include <atomic>
#include <condition_variable>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "formats/base/mailbox.h"
#include "runtime/engine/scan_engine.h"
#include "runtime/player/frame_stats.h"
#include "runtime/tracking/tracker.h"

namespace sonocase::runtime {

inline constexpr double kCineSeconds = 20;
inline constexpr double kCineRate = 60;  // frames a second kept
inline constexpr double kIdleRate = 40;  // frames a second with no new pose
inline constexpr int kMaxEffects = 32;

// What the window wants; taken over between two frames.
struct ScanControls {
    ImageSettings settings;
    SensorAssignment assignment;
    bool frozen = false;
    int cine_back = 0;  // frames back from the newest kept one while frozen
};

// One finished frame, with all that the window shows of it.
struct ScanFrame {
    std::vector<std::uint8_t> pixels;
    int width_px = 0, height_px = 0;
    FrameStatus status = FrameStatus::no_contact;
    FrameRecord record;
    TrackerReading reading;
    Renderer::Layout layout;
    double depth_mm = 0, focus_mm = 0;
    Renderer::Accuracy accuracy;
    std::array<EffectCost, kMaxEffects> costs{};
    int cost_count = 0;
    SensorVerdict probe_verdict = SensorVerdict::absent, needle_verdict = SensorVerdict::absent;
    double rendered_s = 0;  // when finished, session clock
    double frame_ms = 0;
    bool frozen = false;
    int cine_frames = 0;    // kept
    double cine_age_s = 0;  // of the frame shown, against the newest
    double pose_to_pixel_median_ms = 0, pose_to_pixel_p99_ms = 0;
    double frames_per_s = 0;
    std::uint64_t number = 0;
};

// What happens to each live frame on the scan thread: recording, the exercise's metrics, streaming.
using FrameObserver = std::function<void(const ScanFrame&)>;

class ScanThread {
  public:
    explicit ScanThread(SessionClock clock);
    ~ScanThread();  // stops
    ScanThread(const ScanThread&) = delete;
    ScanThread& operator=(const ScanThread&) = delete;

    // Each takes effect between two frames. The bundle must outlive the engine's use: set_engine
    // waits until the thread has let go of the engine before it.
    // keep_session: the new engine continues where the old one stood.
    void set_engine(std::unique_ptr<ScanEngine> engine, bool keep_session = false);
    void set_tracker(std::shared_ptr<Tracker> tracker);
    void set_calibrations(const Calibrations& calibrations);
    void set_observer(FrameObserver observer);
    // Between two frames; false when there is no engine.
    bool with_engine(const std::function<void(ScanEngine&)>& use);
    void set_controls(const ScanControls& controls);

    // Window thread: true if frame() is newer than at the last call.
    bool refresh() { return frames_.refresh(); }
    const ScanFrame& frame() const { return frames_.value(); }

    TrackerHealth tracker_health() const;
    // JSON of --stats over the thread's life.
    std::string stats_json(const std::string& score_json, const std::string& window_json) const;
    void set_first_frame_origin_s(double start_s) { start_s_ = start_s; }
    double first_frame_s() const { return first_frame_s_.load(); }

  private:
    void run();
    bool step();  // one look for work under the lock; true if a frame was made
    void wake();

    SessionClock clock_;
    mutable std::mutex mutex_;  // engine, tracker, controls; held by the thread while it renders
    std::mutex wake_mutex_;
    std::condition_variable wake_condition_;
    bool work_ = false, stop_ = false;

    std::unique_ptr<ScanEngine> engine_;
    std::shared_ptr<Tracker> tracker_;
    Calibrations calibrations_;
    FrameObserver observer_;
    Mailbox<ScanControls> controls_box_;
    ScanControls controls_;
    bool redraw_ = false;

    std::vector<FrameRecord> cine_;  // ring
    std::size_t cine_next_ = 0, cine_count_ = 0;
    double cine_last_s_ = -1, last_frame_s_ = -1;
    TrackerReading reading_;
    FrameStats stats_;
    TimeHistogram pose_to_pixel_;
    double next_reading_s_ = -1;  // of a recording
    double rate_ = 0, last_median_ms_ = 0, last_p99_ms_ = 0;
    std::uint64_t number_ = 0;
    double start_s_ = -1;
    std::atomic<double> first_frame_s_{-1};
    Mailbox<ScanFrame> frames_;
    std::thread thread_;
};

}  // namespace sonocase::runtime
