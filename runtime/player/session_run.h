// SPDX-License-Identifier: Apache-2.0

// A session of the player from its first frame to its scores: events, recording, pictures of the
// moments that matter. Window and headless run drive the same one.
#pragma once

#include <memory>
#include <span>
#include <string>

#include "formats/scoring/session_monitor.h"
#include "formats/scoring/session_score.h"
#include "runtime/engine/scan_engine.h"
#include "runtime/player/open_case.h"
#include "runtime/recording/session_recorder.h"

namespace sonocase::runtime {

class SessionRun {
  public:
    // Begins the engine's session clock at now_s. `open` must outlive the run; the engine may be
    // replaced while it lasts (ScanEngine::take_over). `started`: ISO 8601, UTC.
    static Result<std::unique_ptr<SessionRun>> start(const std::string& path,
                                                     const OpenCase& open,
                                                     ScanEngine& engine,
                                                     const std::string& trainee,
                                                     const std::string& started,
                                                     double now_s);

    // The frame that the engine just rendered. Allocates nothing and waits for nothing, unless
    // `may_wait` (runs faster than life). Returns what happened, valid until the next call.
    std::span<const LiveEvent> observe(const FrameRecord& record,
                                       std::span<const std::uint8_t> pixels,
                                       bool may_wait = false);
    // When later pictures have another size.
    void set_picture_size(int width_px, int height_px) {
        width_px_ = width_px;
        height_px_ = height_px;
    }

    // Live values for the screen.
    const SessionMonitor& monitor() const { return monitor_; }
    RecorderStatus recorder_status() const { return recorder_->status(); }
    const std::string& path() const { return path_; }

    // Ends the recording, scores it and, where the trainee has a name, puts it into the progress
    // book of this machine. The recording is whole even where scoring fails.
    Result<SessionScore> finish();

  private:
    SessionRun(const OpenCase& open, const ScanEngine& engine, std::string path);

    const OpenCase& open_;
    std::shared_ptr<const Anatomy> anatomy_;
    int width_px_, height_px_;
    Exercise exercise_;
    std::string path_;
    SessionMonitor monitor_;
    std::unique_ptr<SessionRecorder> recorder_;
    ImageSettings settings_;
    bool first_ = true;
    FrameRecord last_;
};

// Now, as ISO 8601 in UTC.
std::string utc_now();

// What a session file says of how it was rendered, for its replay: settings in words by frame.
struct SessionReplay {
    SessionHeader header;
    std::vector<std::string> settings;  // # frames; empty text: as before
};
// Nothing where the file is no recording of ours.
std::optional<SessionReplay> session_replay(const std::string& path);

}  // namespace sonocase::runtime
