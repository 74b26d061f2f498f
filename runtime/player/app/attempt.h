// SPDX-License-Identifier: Apache-2.0

// An attempt at the exercise in the window: a session that runs on the scan thread, and what the
// screen shows about it.
#pragma once

#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "runtime/player/session/session_run.h"

namespace sonocase::runtime::inline player_app {

// What the screen shows.
struct AttemptView {
    double seconds = 0;
    int insertions = 0, targets_hit = 0;
    double depth_mm = 0;
    bool tip_in_view = false, in_no_go = false;
    std::vector<Message> events;  // the last ones in words, newest last; at most six
    Message problem;              // of the recorder, a whole sentence; empty: none
};

class Attempt {
  public:
    // The case must outlive the attempt.
    // started: ISO 8601, UTC.
    Attempt(const OpenCase& open,
            const Exercise& exercise,
            std::unique_ptr<SessionRun> run,
            std::string started = "")
        : open_(&open), exercise_(exercise), run_(std::move(run)), started_(std::move(started)) {}

    // After every live frame, called by the thread that renders. width_px, height_px: of the
    // picture.
    void observe(const FrameRecord& record,
                 int width_px,
                 int height_px,
                 const Renderer::Layout& layout,
                 std::span<const std::uint8_t> pixels);
    AttemptView view() const;
    const std::string& path() const { return run_->path(); }
    const std::string& started() const { return started_; }
    // Ends the recording and scores it. No frame may be observed during or after this.
    Result<SessionScore> finish() { return run_->finish(); }

  private:
    const OpenCase* open_;
    Exercise exercise_;
    std::unique_ptr<SessionRun> run_;
    std::string started_;
    mutable std::mutex mutex_;
    AttemptView view_;
};

// A recording for which there is no folder of the user's: it lies among the system's temporary
// files and goes with this object.
class UnkeptRecording {
  public:
    UnkeptRecording();
    ~UnkeptRecording();
    UnkeptRecording(const UnkeptRecording&) = delete;
    UnkeptRecording& operator=(const UnkeptRecording&) = delete;
    const std::string& path() const { return path_; }  // empty: there is no such place either

  private:
    std::string folder_, path_;
};

// A new file in the user's sessions folder; empty if there is no such folder.
std::string new_session_path(const std::string& case_name, const std::string& exercise);

}  // namespace sonocase::runtime::inline player_app
