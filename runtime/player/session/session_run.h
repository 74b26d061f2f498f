// SPDX-License-Identifier: Apache-2.0

// A session of the player from its first frame to its scores, and how a recorded one was rendered,
// so that its replay gives the same pixels.
#pragma once

#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "formats/recording/session.h"
#include "formats/scoring/session_monitor.h"
#include "formats/scoring/session_score.h"
#include "runtime/engine/scan_engine.h"
#include "runtime/player/session/open_case.h"
#include "runtime/recording/session_recorder.h"

namespace sonocase::runtime::inline player_session {

struct SessionReplay {
    SessionHeader header;
    // The console's settings as text (runtime/recording/session_words.h), # frames; empty: as in
    // the frame before.
    std::vector<std::string> settings;
    std::vector<double> times_s;  // # frames, from the first
};
// Nothing if the file is not a recording of this player.
std::optional<SessionReplay> session_replay(const std::string& path);

// A session of the player from its first frame to its scores: events, the recording, and pictures
// of the moments that matter. The window and the headless run use the same one.

class SessionRun {
  public:
    // Begins the engine's session clock at now_s. `open` must outlive the run; the engine may be
    // replaced meanwhile (ScanEngine::take_over). `started`: ISO 8601, UTC. attempt_seed: that the
    // engine's exercise was drawn with. Errors: a recording that cannot be created.
    static Result<std::unique_ptr<SessionRun>> start(const std::string& path,
                                                     const OpenCase& open,
                                                     ScanEngine& engine,
                                                     const std::string& trainee,
                                                     const std::string& started,
                                                     double now_s,
                                                     std::uint64_t attempt_seed = 0);

    // Takes the frame that the engine just rendered. Allocates nothing and waits for nothing,
    // unless `may_wait` (for runs faster than real time). Returns what happened, valid until the
    // next call.
    std::span<const LiveEvent> observe(const FrameRecord& record,
                                       std::span<const std::uint8_t> pixels,
                                       bool may_wait = false);
    // To be called when the size or scale of the pictures changes.
    void set_picture(int width_px, int height_px, const Renderer::Layout& layout) {
        width_px_ = width_px;
        height_px_ = height_px;
        layout_ = layout;
        make_room();
    }

    // Live values for the screen.
    const SessionMonitor& monitor() const { return monitor_; }
    RecorderStatus recorder_status() const { return recorder_->status(); }
    const std::string& path() const { return path_; }

    // Ends the recording, scores it and, if the trainee gave a name, adds it to the progress book
    // of this machine. The recording is complete even if scoring fails.
    Result<SessionScore> finish();
    // Why finish() could not put the scores into the book, and where they are instead; empty: it
    // could, or there was no trainee.
    const Message& not_kept() const { return not_kept_; }

  private:
    // The picture at the deepest point of an insertion, which is known to be that only when the
    // needle goes back.
    struct Deepest {
        bool inserted = false, due = false;  // due: the needle is out, the picture not yet stored
        double depth_mm = 0, time_s = 0;
        std::int64_t frame = 0;
        int width_px = 0, height_px = 0;
        Renderer::Layout layout;
        std::vector<std::uint8_t> pixels;  // as many as the largest picture so far has
    };

    SessionRun(const OpenCase& open, const ScanEngine& engine, std::string path);
    void follow_deepest(std::span<const LiveEvent> events, std::span<const std::uint8_t> pixels);
    void push_deepest();
    void make_room() {
        const auto size =
            static_cast<std::size_t>(width_px_) * static_cast<std::size_t>(height_px_);
        if (deepest_.pixels.size() < size) deepest_.pixels.resize(size);
    }

    const OpenCase& open_;
    std::shared_ptr<const Anatomy> anatomy_;
    int width_px_, height_px_;
    Renderer::Layout layout_;
    Exercise exercise_;
    std::string path_;
    SessionMonitor monitor_;
    std::unique_ptr<SessionRecorder> recorder_;
    ImageSettings settings_;
    bool first_ = true;
    FrameRecord last_;
    Deepest deepest_;
    Message not_kept_;
};

}  // namespace sonocase::runtime::inline player_session
