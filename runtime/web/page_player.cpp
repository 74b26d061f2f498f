// SPDX-License-Identifier: Apache-2.0

#include "runtime/web/page_player.h"

#include <algorithm>
#include <cassert>
#include <utility>

#include "formats/attempt/draw_attempt.h"
#include "formats/exercise/case_exercises.h"
#include "formats/scoring/anatomy.h"

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

// The same for every case; a page opens many.
const std::shared_ptr<const PhysicalTextures>& physical_textures() {
    static const std::shared_ptr<const PhysicalTextures> textures = make_physical_textures();
    return textures;
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
    return of(std::move(*bundle), where);
}

std::unique_ptr<PagePlayer> PagePlayer::of(StreamedBundle bundle, const std::string& where) {
    return std::unique_ptr<PagePlayer>(new PagePlayer(std::move(bundle), where));
}

Result<std::unique_ptr<PagePlayer>> PagePlayer::open_in_parts(RawVector<std::uint8_t> bytes,
                                                              Arrivals arrivals,
                                                              const std::string& where) {
    const std::size_t segments = arrivals.segments();
    auto bundle = stream_bundle_in_parts(std::move(bytes), std::move(arrivals), where);
    if (!bundle) return bundle.error();
    std::unique_ptr<PagePlayer> player(new PagePlayer(std::move(*bundle), where));
    player->plan_ = LoadPlan(segments);
    return player;
}

void PagePlayer::prepare() {
    (void)physical_textures();
}

std::vector<SegmentRun> PagePlayer::next_runs(std::size_t most) {
    if (is_whole()) return {};
    const Point3 middle{0, 0, 0.5 * image_.depth_mm};
    return plan_.next(bundle_, hands_ ? hands_->mannequin_from_probe() * middle : middle, most);
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
    std::optional<Exercise> drawn_before = std::exchange(drawn_, std::nullopt);
    const std::unique_ptr<ScanEngine> engine = std::exchange(engine_, nullptr);
    if (Status made = set_image(image); !made) {
        exercise_index_ = before;
        drawn_ = std::move(drawn_before);
        engine_.reset(engine ? new ScanEngine(std::move(*engine)) : nullptr);
        return made;
    }
    session_.reset();
    hands_ = std::make_unique<MouseTracker>(Skin(*bundle_), exercise);
    return Done{};
}

Status PagePlayer::set_image(const PageImage& image) {
    const Exercise& exercise = exercise_in_use();
    if (image.model == ImageModel::paper && !bundle_.has_textures())
        return Error{"the textures of this picture are still loading", "", "wait for the case"};
    Result<ScanEngine> engine = ScanEngine::create(
        bundle_, exercise,
        engine_options(image, exercise,
                       image.model == ImageModel::physical ? physical_textures() : nullptr));
    if (!engine) return engine.error();
    auto next = std::make_unique<ScanEngine>(std::move(*engine));
    if (engine_) next->take_over(*engine_);
    if (doppler_.begun())
        if (Status made = doppler_.begin(bundle_, *next); !made) return made;
    engine_ = std::move(next);
    truth_.reset();
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
    if (bundle_.blocks()) bundle_.blocks()->forget_awaited();
    const FrameStatus status = engine_->frame(now_s, settings, pixels_);
    FrameRecord record = engine_->last();
    doppler_.frame(*engine_, record, pixels_, true);
    record.doppler = doppler_.report();
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
    if (bundle_.blocks()) bundle_.blocks()->forget_awaited();
    FrameRecord record = kept_record(back);
    record.input.settings = settings;  // gain and TGC still work on a frozen picture
    const FrameStatus status = engine_->frame_again(record, pixels_);
    doppler_.frame(*engine_, record, pixels_, false);
    return status;
}

Status PagePlayer::begin_doppler() {
    return doppler_.begun() ? Status(Done{}) : doppler_.begin(bundle_, *engine_);
}

double PagePlayer::kept_age_s(int back) const {
    if (kept_count_ == 0) return 0;
    return kept_record(0).input.time_s - kept_record(back).input.time_s;
}

Status PagePlayer::start_attempt(const std::string& trainee,
                                 const std::string& started,
                                 double now_s,
                                 std::uint64_t seed) {
    if (seed != 0 && !is_whole())
        return Error{"the case is still loading", "", "a new place of the target needs all of it"};
    const std::optional<Exercise> before = drawn_;
    if (seed != 0) {
        const Exercise& written = exercises_[static_cast<std::size_t>(exercise_index_)];
        const CaseAnatomy at_rest(bundle_);
        drawn_ = draw_attempt(written, at_rest, bundle_->labels, seed).exercise;
        if (Status made = set_image(image_); !made) {
            drawn_ = before;
            return made;
        }
        hands_ = std::make_unique<MouseTracker>(Skin(*bundle_), *drawn_);
    }
    session_ = std::make_unique<PageSession>(*bundle_, *engine_, trainee, started, seed);
    engine_->begin_session(now_s);
    kept_count_ = 0;
    return Done{};
}

Point3 PagePlayer::target_in_probe(std::size_t i) const {
    const FrameRecord& record = engine_->last();
    const Point3 centre = exercise_in_use().targets[i].centre;
    const auto anatomy = engine_->anatomy();
    return inverse(record.tools.mannequin_from_probe) *
           (anatomy ? anatomy->moved(centre, record.input.time_s) : centre);
}

std::string PagePlayer::name_at(int column, int row) {
    if (!engine_->last().tools.has_probe || column < 0 || row < 0 || column >= image_.side_px ||
        row >= image_.side_px)
        return {};
    if (!truth_) {
        auto made = TruthRenderer::create(bundle_, exercise_in_use(), engine_->render_options());
        if (!made) return {};
        truth_.emplace(std::move(*made));
    }
    const PixelTruth there = truth_->at(engine_->last().input, column, row);
    if (!there.scanned || there.label <= 0) return {};
    return bundle_->labels[static_cast<std::size_t>(there.label)].name;
}

Result<FinishedSession> PagePlayer::finish_attempt() {
    assert(session_);
    if (!is_whole()) return Error{"the case is still loading", "", "scores need all of it"};
    const std::unique_ptr<PageSession> session = std::move(session_);
    return session->finish();
}

}  // namespace sonocase::runtime
