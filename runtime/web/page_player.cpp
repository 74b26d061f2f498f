// SPDX-License-Identifier: Apache-2.0

#include "runtime/web/page_player.h"

#include <algorithm>
#include <cassert>
#include <utility>

#include "formats/exercise/case_exercises.h"

namespace sonocase::runtime {
namespace {

constexpr double kKeptSeconds = 20;
constexpr double kKeptRate = 60;  // pictures per second that are kept

EngineOptions engine_options(const PageImage& image,
                             const Exercise& exercise,
                             std::shared_ptr<const PhysicalTextures> textures) {
    EngineOptions options;
    options.depth_mm = image.depth_mm;
    options.focus_mm = image.focus_mm;
    options.render.model = image.model;
    options.render.width_px = options.render.height_px = image.side_px;
    options.render.effects = exercise.effects;
    options.render.textures = std::move(textures);
    return options;
}

}  // namespace

PagePlayer::PagePlayer(StreamedBundle bundle, const std::string& where)
    : bundle_(std::move(bundle)), kept_(static_cast<std::size_t>(kKeptSeconds * kKeptRate)) {
    CaseExercises found = exercises_of(*bundle_, where);
    exercises_ = std::move(found.exercises);
    warnings_ = std::move(found.warnings);
}

Result<std::unique_ptr<PagePlayer>> PagePlayer::open(RawVector<std::uint8_t> bytes,
                                                     const std::string& where) {
    Result<StreamedBundle> bundle = stream_bundle(std::move(bytes), where);
    if (!bundle) return bundle.error();
    return std::unique_ptr<PagePlayer>(new PagePlayer(std::move(*bundle), where));
}

Status PagePlayer::choose_exercise(int index, int side_px) {
    const int count = static_cast<int>(exercises_.size());
    const int wanted = (index % count + count) % count;
    const Exercise& exercise = exercises_[static_cast<std::size_t>(wanted)];
    PageImage image;
    image.model = exercise.model == "paper" ? ImageModel::paper : ImageModel::physical;
    image.side_px = side_px;
    image.depth_mm = exercise.probe.depth_mm;
    image.focus_mm = exercise.probe.focus_mm;
    const int before = std::exchange(exercise_index_, wanted);
    const std::unique_ptr<ScanEngine> engine = std::exchange(engine_, nullptr);
    if (Status made = set_image(image); !made) {
        exercise_index_ = before;
        engine_.reset(engine ? new ScanEngine(std::move(*engine)) : nullptr);
        return made;
    }
    session_.reset();
    hands_ = std::make_unique<MouseTracker>(Skin(*bundle_), exercise);
    return Done{};
}

Status PagePlayer::set_image(const PageImage& image) {
    const Exercise& exercise = exercises_[static_cast<std::size_t>(exercise_index_)];
    if (image.model == ImageModel::physical && !textures_) textures_ = make_physical_textures();
    Result<ScanEngine> engine =
        ScanEngine::create(bundle_, exercise, engine_options(image, exercise, textures_));
    if (!engine) return engine.error();
    auto next = std::make_unique<ScanEngine>(std::move(*engine));
    if (engine_) next->take_over(*engine_);
    engine_ = std::move(next);
    image_ = image;
    pixels_.assign(
        static_cast<std::size_t>(image.side_px) * static_cast<std::size_t>(image.side_px),
        std::uint8_t{0});
    kept_count_ = 0;
    kept_last_s_ = -1;
    if (session_) session_->use(*engine_);
    return Done{};
}

void PagePlayer::put_tools(double now_s, const TrackerReading& reading) {
    TrackerReading moved;
    (void)hands_->poll(now_s, moved);  // what the hands did before is settled
    engine_->observe(reading, true);
}

FrameStatus PagePlayer::frame(double now_s, const ImageSettings& settings) {
    TrackerReading reading;
    if (hands_->poll(now_s, reading)) engine_->observe(reading, false);
    const FrameStatus status = engine_->frame(now_s, settings, pixels_);
    const FrameRecord& record = engine_->last();
    // A session's clock starts over, so that time may fall.
    if (kept_last_s_ < 0 || now_s < kept_last_s_ || now_s - kept_last_s_ >= 0.98 / kKeptRate) {
        kept_[kept_next_] = record;
        kept_next_ = (kept_next_ + 1) % kept_.size();
        kept_count_ = std::min(kept_count_ + 1, kept_.size());
        kept_last_s_ = now_s;
    }
    if (session_) session_->observe(record);
    return status;
}

const FrameRecord& PagePlayer::kept_record(int back) const {
    assert(kept_count_ > 0);
    const std::size_t size = kept_.size();
    const std::size_t n = std::min(static_cast<std::size_t>(std::max(back, 0)), kept_count_ - 1);
    return kept_[(kept_next_ + 2 * size - 1 - n) % size];
}

FrameStatus PagePlayer::frame_again(int back, const ImageSettings& settings) {
    if (kept_count_ == 0) return FrameStatus::no_contact;
    FrameRecord record = kept_record(back);
    record.input.settings = settings;  // gain and TGC still work on a frozen picture
    return engine_->frame_again(record, pixels_);
}

double PagePlayer::kept_age_s(int back) const {
    if (kept_count_ == 0) return 0;
    return kept_record(0).input.time_s - kept_record(back).input.time_s;
}

void PagePlayer::start_attempt(const std::string& trainee,
                               const std::string& started,
                               double now_s) {
    session_ = std::make_unique<PageSession>(*bundle_, *engine_, trainee, started);
    engine_->begin_session(now_s);
    kept_count_ = 0;
}

Result<FinishedSession> PagePlayer::finish_attempt() {
    assert(session_);
    const std::unique_ptr<PageSession> session = std::move(session_);
    return session->finish();
}

}  // namespace sonocase::runtime
