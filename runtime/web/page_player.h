// SPDX-License-Identifier: Apache-2.0

// The player behind a page: bytes of a case in, pictures, scores and the bytes of a recording out.
// It does what scan thread and attempt do for the window, on the caller's thread and without files,
// so that a page calls it between two pictures. The page itself is runtime/web/page.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "formats/bundle/streamed_bundle.h"
#include "formats/exercise/exercise.h"
#include "runtime/engine/scan_engine.h"
#include "runtime/imaging/truth/frame_truth.h"
#include "runtime/tracking/mouse_tracker.h"
#include "runtime/web/load_plan.h"
#include "runtime/web/page_doppler.h"
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

    // The same of a case that is in memory.
    static std::unique_ptr<PagePlayer> of(StreamedBundle bundle, const std::string& where);

    // The same of a case that arrives in segments, with those of parts_to_open() there.
    static Result<std::unique_ptr<PagePlayer>> open_in_parts(RawVector<std::uint8_t> bytes,
                                                             Arrivals arrivals,
                                                             const std::string& where);

    // Makes what all players share, so that the first one need not.
    static void prepare();

    const StreamedBundle& bundle() const { return bundle_; }
    // For a case that arrives in segments: see streamed_bundle.h. A segment's bytes are checked
    // before it has arrived.
    std::span<std::uint8_t> bytes() { return bundle_.bytes(); }
    void arrived(std::size_t segment) { bundle_.arrived(segment); }
    Status look_again() { return bundle_.look_again(); }
    bool is_whole() const { return !bundle_.arrivals() || bundle_.arrivals()->whole(); }
    // Blocks that the last picture lacked: surfaces are smoother there and tissue has less
    // structure.
    int missing_blocks() const {
        return bundle_.blocks() ? static_cast<int>(bundle_.blocks()->awaited()) : 0;
    }
    // What to fetch next (load_plan.h); most: segments ahead of what the picture lacks.
    std::vector<SegmentRun> next_runs(std::size_t most);
    void ask_again(SegmentRun run) { plan_.ask_again(run); }
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

    // Before frames whose settings ask for a Doppler mode; until then they show none. Error: blood
    // flow has not arrived yet.
    Status begin_doppler();
    // Of the last frame.
    PageDoppler& doppler() { return doppler_; }
    const PageDoppler& doppler() const { return doppler_; }

    // started: ISO 8601, UTC. seed: that targets and start are drawn with (formats/attempt); 0: as
    // written. Else the probe goes to the start without a needle, and the case has to be whole: a
    // draw looks at all of it. Errors: it is not; the image cannot be made.
    Status start_attempt(const std::string& trainee,
                         const std::string& started,
                         double now_s,
                         std::uint64_t seed = 0);
    // Middle of the exercise's target i, `probe` frame of the last picture: for a page that may
    // show it. Where breathing has moved it.
    Point3 target_in_probe(std::size_t i) const;
    // What the last picture shows at a pixel, a label's name; empty: nothing. Cost: microseconds,
    // and some ms the first time in an image.
    std::string name_at(int column, int row);
    void drop_attempt() { session_.reset(); }
    // Null: none runs.
    const PageSession* attempt() const { return session_.get(); }
    // Ends the attempt and scores it. Only while one runs. Error: the case is not whole yet; the
    // attempt goes on.
    Result<FinishedSession> finish_attempt();

  private:
    PagePlayer(StreamedBundle bundle, const std::string& where);
    const FrameRecord& kept_record(int back) const;
    const Exercise& exercise_in_use() const {
        return drawn_ ? *drawn_ : exercises_[static_cast<std::size_t>(exercise_index_)];
    }

    StreamedBundle bundle_;
    LoadPlan plan_;
    std::vector<Exercise> exercises_;
    std::vector<std::string> warnings_;
    int exercise_index_ = 0;
    std::optional<Exercise> drawn_;  // of the attempt that runs or ran last; nothing: as written
    std::optional<TruthRenderer> truth_;  // of the image; made when it is first asked
    PageImage image_;
    std::vector<std::uint8_t> pixels_;
    std::unique_ptr<ScanEngine> engine_;
    PageDoppler doppler_;
    std::unique_ptr<MouseTracker> hands_;
    std::unique_ptr<PageSession> session_;
    std::vector<FrameRecord> kept_;  // ring
    std::size_t kept_next_ = 0, kept_count_ = 0;
    double kept_last_s_ = -1;
};

}  // namespace sonocase::runtime
