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

#include "formats/base/result.h"
#include "formats/bundle/case_bundle.h"
#include "formats/bundle/signature.h"
#include "formats/exercise/exercise.h"
#include "formats/recording/session.h"
#include "formats/scoring/session_monitor.h"
#include "formats/scoring/session_score.h"
#include "runtime/engine/scan_engine.h"
#include "runtime/imaging/doppler/box_hands.h"
#include "runtime/imaging/doppler/doppler_view.h"
#include "runtime/imaging/truth/frame_truth.h"
#include "runtime/tracking/mouse_tracker.h"
#include "runtime/tracking/scripted_sweep.h"
#include "runtime/web/load_plan.h"

namespace sonocase::runtime::inline web {

// The recording is what sonoplay writes (docs/format.md, part 7), complete even without a score.
struct FinishedSession {
    std::vector<std::uint8_t> recording;  // bytes of an .igs.mha
    SessionScore score;
    std::string score_json;  // as `sonoplay --stats` and `sonocase review` give it
};

// An attempt on a page: what SessionRun is to the window, kept in memory instead of a file.
class PageSession {
  public:
    // The bundle must outlive the session. seed: of the attempt; 0: as written.
    PageSession(const CaseBundle& bundle,
                const ScanEngine& engine,
                const std::string& trainee,
                const std::string& started,
                std::uint64_t seed = 0);

    // Another engine of the same exercise goes on.
    void use(const ScanEngine& engine) { anatomy_ = engine.anatomy(); }
    // A tracker moves the tools: the recording names it.
    void moved_by(const std::string& tracker);
    // Takes the frame that the engine just rendered.
    void observe(const FrameRecord& record);

    double seconds() const;
    const SessionMonitor& monitor() const { return monitor_; }
    const std::vector<Message>& words() const { return words_; }  // the last six, newest last

    // The scores are those of the recording's bytes, read again as a replay would read them.
    Result<FinishedSession> finish() const;

  private:
    const CaseBundle& bundle_;
    Exercise exercise_;
    std::shared_ptr<const Anatomy> first_anatomy_, anatomy_;  // the monitor keeps the first
    SessionMonitor monitor_;
    Session session_;
    ImageSettings settings_;
    std::vector<Message> words_;
};

// The Doppler modes of a page: what DopplerFrames and DopplerRun are to the desktop, with an
// overlay and a strip that the page colours itself.
class PageDoppler {
  public:
    // Before the first frame of a mode, and again for each engine. The bundle must outlive what is
    // made. Error: blood flow has not arrived yet.
    Status begin(const StreamedBundle& bundle, const ScanEngine& engine);
    void end() { view_.reset(); }
    bool begun() const { return view_ != nullptr; }
    bool has_flow() const { return view_ && view_->has_flow(); }

    // Draws the frame that the engine rendered last, from `record`. live: false for a kept one,
    // whose strip stays as it was frozen.
    void frame(const ScanEngine& engine,
               const FrameRecord& record,
               std::span<const std::uint8_t> pixels,
               bool live);
    DopplerMode mode() const { return mode_; }  // of the last frame
    DopplerReport report() const { return view_ ? view_->report() : DopplerReport{}; }

    // # pixels of the picture: index into doppler::palette(), 0: grey. Empty: no colour.
    std::span<const std::uint8_t> overlay() const;
    // Grey, # width * height; empty: the mode has none.
    std::span<const std::uint8_t> strip(int width, int height);
    // Pairs of samples of the last live frame (towards, away), and their rate.
    std::span<const float> sound() const;
    double sound_hz() const { return view_ ? view_->spectrum().sound_hz() : 0; }
    doppler::SpectralMeasures measures() const;
    double machine_hz() const { return view_ ? view_->colour().frame_hz : 0; }

    // Settings with box, gate and cursor in the widest vessel of the last picture's plane.
    DopplerSettings aimed(const ScanEngine& engine, const DopplerSettings& settings) const;

  private:
    std::unique_ptr<DopplerView> view_;
    DopplerMode mode_ = DopplerMode::off;
    bool live_ = false;
    std::vector<std::uint8_t> strip_;
};

// Where the lines of the engine's picture run, for what a pointer takes hold of (box_hands.h).
ScanGeometry doppler_geometry(const ScanEngine& engine);

// What the engine draws; the console of the page changes it.
struct PageImage {
    ImageModel model = ImageModel::physical;
    int width_px = 512, height_px = 512;
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
    // These are for a case that arrives in segments (formats/bundle/case_bundle.h). A segment's
    // bytes are checked before it has arrived.
    std::span<std::uint8_t> bytes() { return bundle_.bytes(); }
    void arrived(std::size_t segment) { bundle_.arrived(segment); }
    Status look_again() { return bundle_.read_arrived(); }
    bool is_whole() const { return !bundle_.arrivals() || bundle_.arrivals()->whole(); }
    // Blocks that the last picture lacked: surfaces are smoother there and tissue has less
    // structure.
    int missing_blocks() const {
        return bundle_.blocks() ? static_cast<int>(bundle_.blocks()->awaited()) : 0;
    }
    // What to fetch next (load_plan.h); max_segments: ahead of what the picture lacks.
    std::vector<SegmentRun> next_runs(std::size_t max_segments);
    void ask_again(SegmentRun run) { plan_.ask_again(run); }
    // Goes on checking the author's signature, some ms at each call. Null: not done yet, or the
    // case is not whole.
    const CaseSignature* check_signature();
    const std::vector<Exercise>& exercises() const { return exercises_; }
    const std::vector<Message>& warnings() const { return warnings_; }

    // Begins an exercise in its own image: the probe goes to its start, an attempt is dropped.
    // index: taken modulo the number of exercises.
    Status choose_exercise(int index, int width_px, int height_px);
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
    // tracker: its word in the recording of an attempt that runs; empty: none.
    void put_tools(double now_s, const TrackerReading& reading, const std::string& tracker = "");

    // Plays a sweep of the exercise from its beginning, as an expert is watched; hands do nothing
    // meanwhile. Ends with it, with end_watching() or with an attempt. Only without an attempt.
    // Error: the exercise has no sweep of that name.
    Status watch(const std::string& sweep, double now_s);
    void end_watching() { watched_.reset(); }
    bool watching() const { return watched_ != nullptr; }

    // The picture of now; observed by the attempt, if one runs.
    FrameStatus frame(double now_s, const ImageSettings& settings);
    // The same behind a frozen picture, for an attempt alone: pixels() and the kept ones stay.
    void frame_unseen(double now_s, const ImageSettings& settings);
    // A kept picture of the last 20 seconds, `back` pictures before the newest, 0 to kept() - 1.
    FrameStatus frame_again(int back, const ImageSettings& settings);
    int kept() const {
        return static_cast<int>(looks_at_attempt_ ? attempt_kept_.size() : kept_count_);
    }
    // The pictures of the attempt that ended last are the kept ones until the next live frame: ten
    // a second, fewer where it was longer than five minutes. Returns how many lie behind the one at
    // that time of the attempt; -1: none was kept, and those of the last seconds stay.
    int look_at_attempt(double time_s);
    double kept_age_s(int back) const;  // time from that picture to the newest
    // # width_px * height_px, of the last picture.
    std::span<const std::uint8_t> pixels() const { return pixels_; }

    // Before frames whose settings ask for a Doppler mode; until then they show none. Error: blood
    // flow has not arrived yet.
    Status begin_doppler();
    // What the last frame showed.
    PageDoppler& doppler() { return doppler_; }
    const PageDoppler& doppler() const { return doppler_; }

    // An act of the exercise's procedure, for the next frame. False: too many wait already.
    bool act(const Act& act) { return engine_->act(act); }

    // started: ISO 8601, UTC. seed: that targets and start are drawn with (draw_attempt.h); 0: as
    // written. Else the probe goes to the start without a needle, and the case has to be whole: a
    // draw reads all of it. Errors: it is not whole; the image cannot be made.
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
        return drawn_ ? *drawn_ : exercises_[exercise_index_];
    }

    StreamedBundle bundle_;
    std::optional<SignatureCheck> signature_;  // begun once the case is whole
    LoadPlan plan_;
    std::vector<Exercise> exercises_;
    std::vector<Message> warnings_;
    int exercise_index_ = 0;
    std::optional<Exercise> drawn_;  // of the attempt that runs or ran last; nothing: as written
    std::optional<TruthRenderer> truth_;  // of the image; made when it is first asked
    PageImage image_;
    std::vector<std::uint8_t> pixels_;
    std::unique_ptr<ScanEngine> engine_;
    PageDoppler doppler_;
    std::unique_ptr<MouseTracker> hands_;
    std::unique_ptr<ScriptedSweep> watched_;
    std::unique_ptr<PageSession> session_;
    void keep(const FrameRecord& record, double now_s);

    std::vector<FrameRecord> attempt_kept_;  // of the attempt that runs or ran last
    double attempt_step_s_ = 0;
    bool looks_at_attempt_ = false;
    std::vector<FrameRecord> kept_;  // ring
    std::size_t kept_next_ = 0, kept_count_ = 0;
    double kept_last_s_ = -1;
    std::vector<std::uint8_t> unseen_;
};

}  // namespace sonocase::runtime::inline web
