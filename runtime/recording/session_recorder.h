// SPDX-License-Identifier: Apache-2.0

// Writes a session while it runs, on a thread of its own. The frame loop hands over a record and
// never waits; what it handed over is on the disk within half a second.
//
// Files: FILE.igs.mha, complete at every moment (formats/files/growing_sequence.h), and beside it
// FILE.frames.igs.mha with the pictures of the moments that matter, made with the first of them.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "formats/base/result.h"
#include "formats/exercise/exercise.h"
#include "formats/recording/session.h"
#include "formats/scoring/session_monitor.h"
#include "formats/volume/label_volume.h"
#include "runtime/imaging/core/frame_input.h"
#include "runtime/imaging/renderer.h"

namespace sonocase::runtime::inline recording {

// One frame of the player. Fixed size, so that handing it over allocates nothing.
struct RecordedFrame {
    double time_s = 0;       // FrameInput::time_s
    std::int64_t frame = 0;  // FrameInput::frame
    bool probe_ok = false, needle_ok = false;
    double probe_age_s = 0, needle_age_s = 0;
    Rigid mannequin_from_probe, mannequin_from_needle, mannequin_from_drawn;
    bool has_press = false;
    PressSample press;
    DopplerReport doppler;
    ActList acts;
    bool unseen = false;
    // The console's settings as text (settings_text.h) where they changed; empty otherwise.
    std::array<char, 640> settings{};
};

struct RecorderStatus {
    std::size_t frames_written = 0;
    std::size_t frames_dropped = 0;  // lost because the writer was more than a minute behind
    Message problem;                 // a whole sentence for the trainee; empty: none
};

class SessionRecorder {
  public:
    // exercise, labels: name the events; copied. Errors: a file that cannot be created.
    static Result<std::unique_ptr<SessionRecorder>> start(const std::string& path,
                                                          const SessionHeader& header,
                                                          const Exercise& exercise,
                                                          const std::vector<Label>& labels);
    ~SessionRecorder();  // writes the rest
    SessionRecorder(const SessionRecorder&) = delete;
    SessionRecorder& operator=(const SessionRecorder&) = delete;

    // From the frame loop. Never blocks and never allocates; keeps at most 8 events per frame.
    // False if the writer is so far behind that the frame is lost; status() counts those.
    bool push(const RecordedFrame& frame, std::span<const LiveEvent> events);
    // Keeps the picture of a frame that was pushed: grey, # width_px * height_px, copied; pictures
    // are ordered by their times. False, and nothing is kept, while the one before is written.
    // `why` is a string literal.
    bool push_picture(std::int64_t frame,
                      double time_s,
                      const char* why,
                      int width_px,
                      int height_px,
                      std::span<const std::uint8_t> pixels,
                      const Renderer::Layout& layout = {});

    // Waits until there is room for frames and a picture; for runs faster than real time.
    void wait_for_room();

    RecorderStatus status() const;  // for the screen; takes a lock for the time of a copy
    // Writes the rest and ends the thread. Error: frames did not reach the disk.
    Status finish();

  private:
    struct Impl;
    explicit SessionRecorder(std::unique_ptr<Impl> impl);
    std::unique_ptr<Impl> impl_;
};

// "x.igs.mha" -> "x.frames.igs.mha".
std::string pictures_path(const std::string& session_path);

}  // namespace sonocase::runtime::inline recording
