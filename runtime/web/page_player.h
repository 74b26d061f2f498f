// SPDX-License-Identifier: Apache-2.0

// The player behind a page: bytes of a case in, pictures, scores and the bytes of a recording out.
// It does what scan thread and attempt do for the window, on the caller's thread and without files,
// so that a page calls it between two pictures. The page itself is runtime/web/page.
#pragma once

#include <memory>
#include <span>
#include <string>
#include <vector>

#include "formats/bundle/streamed_bundle.h"
#include "formats/exercise/exercise.h"
#include "runtime/engine/scan_engine.h"
#include "runtime/tracking/mouse_tracker.h"
#include "runtime/web/page_session.h"

namespace sonocase::runtime {

// What the engine draws; the console of the page changes it.
struct PageImage {
    ImageModel model = ImageModel::physical;
    int side_px = 512;                  // width and height
    double depth_mm = 0, focus_mm = 0;  // 0: the exercise's
};

class PagePlayer {
  public:
    // where: names the case in errors. Errors: bytes that are not a bundle.
    static Result<std::unique_ptr<PagePlayer>> open(RawVector<std::uint8_t> bytes,
                                                    const std::string& where);

    const StreamedBundle& bundle() const { return bundle_; }
    const std::vector<Exercise>& exercises() const { return exercises_; }
    const std::vector<std::string>& warnings() const { return warnings_; }

    // Begins an exercise in its own image: the probe goes to its start, an attempt is dropped.
    // index: taken modulo the number of exercises.
    Status choose_exercise(int index, int side_px);
    // Another image of the same exercise; session clock and frame numbers continue.
    Status set_image(const PageImage& image);
    const PageImage& image() const { return image_; }
    int exercise_index() const { return exercise_index_; }
    // All below: only after choose_exercise() has succeeded.
    const Exercise& exercise() const { return engine_->exercise(); }
    const ScanEngine& engine() const { return *engine_; }

    // Probe and needle as hands move them.
    MouseTracker& hands() { return *hands_; }
    // A pose from elsewhere (a tracker, a test) instead of the hands', until the hands move again.
    void put_tools(double now_s, const TrackerReading& reading);

    // The picture of now; observed by the attempt, if one runs.
    FrameStatus frame(double now_s, const ImageSettings& settings);
    // A kept picture of the last 20 seconds, `back` pictures before the newest, 0 to kept() - 1.
    FrameStatus frame_again(int back, const ImageSettings& settings);
    int kept() const { return static_cast<int>(kept_count_); }
    double kept_age_s(int back) const;  // time from that picture to the newest
    // # side_px * side_px, of the last picture.
    std::span<const std::uint8_t> pixels() const { return pixels_; }

    // started: ISO 8601, UTC.
    void start_attempt(const std::string& trainee, const std::string& started, double now_s);
    void drop_attempt() { session_.reset(); }
    // Null: none runs.
    const PageSession* attempt() const { return session_.get(); }
    // Ends the attempt and scores it. Only while one runs.
    Result<FinishedSession> finish_attempt();

  private:
    PagePlayer(StreamedBundle bundle, const std::string& where);
    const FrameRecord& kept_record(int back) const;

    StreamedBundle bundle_;
    std::vector<Exercise> exercises_;
    std::vector<std::string> warnings_;
    std::shared_ptr<const PhysicalTextures> textures_;
    int exercise_index_ = 0;
    PageImage image_;
    std::vector<std::uint8_t> pixels_;
    std::unique_ptr<ScanEngine> engine_;
    std::unique_ptr<MouseTracker> hands_;
    std::unique_ptr<PageSession> session_;
    std::vector<FrameRecord> kept_;  // ring
    std::size_t kept_next_ = 0, kept_count_ = 0;
    double kept_last_s_ = -1;
};

}  // namespace sonocase::runtime
