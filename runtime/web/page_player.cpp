// SPDX-License-Identifier: Apache-2.0

#include "runtime/web/page_player.h"

#include <algorithm>
#include <cassert>
#include <optional>
#include <span>
#include <utility>

#include "formats/exercise/case_exercises.h"
#include "formats/scoring/anatomy.h"
#include "formats/scoring/draw_attempt.h"
#include "runtime/engine/scan_engine.h"
#include "runtime/imaging/doppler/doppler_picture.h"
#include "runtime/recording/session_words.h"

namespace sonocase::runtime::inline web {

namespace {

constexpr std::size_t kWords = 6;

bool same(const ImageSettings& a, const ImageSettings& b) {
    return a.gain_db == b.gain_db && a.dynamic_range_db == b.dynamic_range_db &&
           a.tgc_db == b.tgc_db && a.press_mm == b.press_mm &&
           a.flip_left_right == b.flip_left_right && a.doppler == b.doppler;
}

}  // namespace

PageSession::PageSession(const CaseBundle& bundle,
                         const ScanEngine& engine,
                         const std::string& trainee,
                         const std::string& started,
                         std::uint64_t seed)
    : bundle_(bundle),
      exercise_(engine.exercise()),
      first_anatomy_(engine.anatomy()),
      anatomy_(first_anatomy_),
      monitor_(exercise_, first_anatomy_.get(), bundle.labels) {
    session_.header = session_header(bundle, exercise_, engine.render_options(), trainee, started);
    if (seed != 0) session_.header.attempt = "seed=" + std::to_string(seed);
}

void PageSession::moved_by(const std::string& tracker) {
    std::string& attempt = session_.header.attempt;
    if (!detail_value(attempt, "tracker").empty()) return;
    attempt += (attempt.empty() ? "tracker=" : " tracker=") + tracker;
}

void PageSession::observe(const FrameRecord& record) {
    const FrameInput& input = record.input;
    SessionSample sample;
    fill_sample(record, sample);
    sample.has_doppler = record.doppler.on;
    sample.doppler = doppler_sample(record.doppler, bundle_.labels);
    if (session_.samples.empty() || !same(settings_, input.settings))
        sample.settings = settings_text(input.settings);
    settings_ = input.settings;
    monitor_.update(sample.time_s, sample.frame, sample.probe_ok, sample.mannequin_from_probe,
                    sample.needle_ok, sample.mannequin_from_drawn, sample.unseen);
    report_punctures(record.puncture, monitor_);
    monitor_.report_procedure(record.new_steps, record.new_complications);
    const std::span<const LiveEvent> events = monitor_.events();
    for (const LiveEvent& event : events) {
        session_.events.push_back(session_event(event, exercise_, bundle_.labels));
        Message words = event_words(event, exercise_, bundle_.labels);
        if (words.empty()) continue;
        words_.push_back(std::move(words));
        if (words_.size() > kWords) words_.erase(words_.begin());
    }
    session_.samples.push_back(std::move(sample));
}

double PageSession::seconds() const {
    return session_.samples.empty() ? 0 : session_.samples.back().time_s;
}

Result<FinishedSession> PageSession::finish() const {
    FinishedSession out;
    out.recording = write_sequence(sequence_from_session(session_), SequenceForm::mha);
    SONOCASE_TRY(const auto sequence, read_sequence(out.recording, "recording"));
    SONOCASE_TRY(const auto session,
                 session_from_sequence(sequence, guess_names(sequence), "recording"));
    out.score = score_session(session, exercise_, anatomy_.get(), bundle_.labels);
    out.score_json = score_json(out.score, exercise_);
    return out;
}

Status PageDoppler::begin(const StreamedBundle& bundle, const ScanEngine& engine) {
    if (!bundle.has_flow())
        return Error{"the flow of blood in this case is still loading", "", "wait for the case"};
    SONOCASE_TRY(auto view,
                 DopplerView::create(bundle, engine.exercise(), engine.render_options()));
    view_ = std::make_unique<DopplerView>(std::move(view));
    return Done{};
}

void PageDoppler::frame(const ScanEngine& engine,
                        const FrameRecord& record,
                        std::span<const std::uint8_t> pixels,
                        bool live) {
    live_ = live;
    mode_ = view_ ? record.input.settings.doppler.mode : DopplerMode::off;
    if (!view_) return;
    const bool strip = mode_ == DopplerMode::spectral || mode_ == DopplerMode::m_mode;
    // A strip runs on with the time of live frames; going back would begin it anew.
    if (live || !strip) view_->frame(record.input, engine.renderer(), pixels);
}

std::span<const std::uint8_t> PageDoppler::overlay() const {
    if (mode_ != DopplerMode::colour && mode_ != DopplerMode::power) return {};
    return view_->overlay();
}

std::span<const std::uint8_t> PageDoppler::strip(int width, int height) {
    if (mode_ != DopplerMode::spectral && mode_ != DopplerMode::m_mode) return {};
    strip_.resize(static_cast<std::size_t>(width) * height);
    if (mode_ == DopplerMode::spectral)
        doppler::draw_spectrum(view_->spectrum(), kStripSeconds, width, height, strip_);
    else
        doppler::draw_m_mode(view_->m_mode(), width, height, strip_);
    return strip_;
}

std::span<const float> PageDoppler::sound() const {
    if (mode_ != DopplerMode::spectral || !live_) return {};
    return view_->spectrum().sound();
}

doppler::SpectralMeasures PageDoppler::measures() const {
    return mode_ == DopplerMode::spectral ? view_->spectrum().measures()
                                          : doppler::SpectralMeasures{};
}

DopplerSettings PageDoppler::aimed(const ScanEngine& engine,
                                   const DopplerSettings& settings) const {
    FrameInput input;
    input.mannequin_from_probe = engine.last().tools.mannequin_from_probe;
    return view_ ? view_->aimed(input, settings) : settings;
}

ScanGeometry doppler_geometry(const ScanEngine& engine) {
    const RenderOptions& options = engine.render_options();
    return make_scan_geometry(engine.exercise().probe, doppler::kColourLines, doppler::kColourRows,
                              options.width_px, options.height_px);
}

namespace {

constexpr double kAttemptStepS = 0.1;  // between the kept pictures of an attempt
constexpr std::size_t kAttemptMost = 3000;
constexpr double kKeptSeconds = 20;
constexpr double kKeptRate = 60;  // pictures per second that are kept

EngineOptions engine_options(const PageImage& image,
                             const Exercise& exercise,
                             std::shared_ptr<const PhysicalTextures> textures) {
    EngineOptions options;
    options.depth_mm = image.depth_mm;
    options.focus_mm = image.focus_mm;
    options.render.model = image.model;
    options.render.width_px = image.width_px;
    options.render.height_px = image.height_px;
    options.render.effects = exercise.effects;
    options.render.textures = std::move(textures);
    return options;
}

// The tables are the same for every case, and a page opens many.
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
    SONOCASE_TRY(StreamedBundle bundle, stream_bundle(std::move(bytes), where));
    return of(std::move(bundle), where);
}

std::unique_ptr<PagePlayer> PagePlayer::of(StreamedBundle bundle, const std::string& where) {
    return std::unique_ptr<PagePlayer>(new PagePlayer(std::move(bundle), where));
}

Result<std::unique_ptr<PagePlayer>> PagePlayer::open_in_parts(RawVector<std::uint8_t> bytes,
                                                              Arrivals arrivals,
                                                              const std::string& where) {
    const std::size_t segments = arrivals.segments();
    SONOCASE_TRY(auto bundle, stream_bundle_in_parts(std::move(bytes), std::move(arrivals), where));
    std::unique_ptr<PagePlayer> player(new PagePlayer(std::move(bundle), where));
    player->plan_ = LoadPlan(segments);
    return player;
}

void PagePlayer::prepare() {
    (void)physical_textures();
}

std::vector<SegmentRun> PagePlayer::next_runs(std::size_t max_segments) {
    if (is_whole()) return {};
    const Point3 middle{0, 0, 0.5 * image_.depth_mm};
    return plan_.next(bundle_, hands_ ? hands_->mannequin_from_probe() * middle : middle,
                      max_segments);
}

const CaseSignature* PagePlayer::check_signature() {
    if (!is_whole()) return nullptr;
    if (!signature_) signature_.emplace(bundle_.bytes());
    return signature_->step() ? &signature_->result() : nullptr;
}

Status PagePlayer::choose_exercise(int index, int width_px, int height_px) {
    const int count = static_cast<int>(exercises_.size());
    const int wanted = (index % count + count) % count;
    const Exercise& exercise = exercises_[wanted];
    PageImage image;
    image.model = exercise.model == "paper" ? ImageModel::paper : ImageModel::physical;
    image.width_px = width_px;
    image.height_px = height_px;
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
    watched_.reset();
    attempt_kept_.clear();
    looks_at_attempt_ = false;
    hands_ = std::make_unique<MouseTracker>(Skin(*bundle_), exercise);
    return Done{};
}

Status PagePlayer::set_image(const PageImage& image) {
    const Exercise& exercise = exercise_in_use();
    if (image.model == ImageModel::paper && !bundle_.has_textures())
        return Error{"the textures of this picture are still loading", "", "wait for the case"};
    SONOCASE_TRY(
        ScanEngine engine,
        ScanEngine::create(
            bundle_, exercise,
            engine_options(image, exercise,
                           image.model == ImageModel::physical ? physical_textures() : nullptr)));
    auto next = std::make_unique<ScanEngine>(std::move(engine));
    if (engine_) next->take_over(*engine_);
    if (doppler_.begun())
        if (Status made = doppler_.begin(bundle_, *next); !made) return made;
    engine_ = std::move(next);
    truth_.reset();
    image_ = image;
    pixels_.assign(static_cast<std::size_t>(image.width_px) * image.height_px, std::uint8_t{0});
    kept_count_ = 0;
    kept_last_s_ = -1;
    if (session_) session_->use(*engine_);
    return Done{};
}

void PagePlayer::put_tools(double now_s,
                           const TrackerReading& reading,
                           const std::string& tracker) {
    if (session_ && !tracker.empty()) session_->moved_by(tracker);
    TrackerReading moved;
    (void)hands_->poll(now_s, moved);  // what the hands did before is applied
    engine_->observe(reading, true);
}

Status PagePlayer::watch(const std::string& sweep, double now_s) {
    assert(!session_);
    for (const Sweep& one : exercise_in_use().sweeps) {
        if (one.name != sweep) continue;
        watched_ = std::make_unique<ScriptedSweep>(one, Skin(*bundle_), false);
        engine_->begin_session(now_s);
        kept_count_ = 0;
        return Done{};
    }
    return Error{"the exercise has no expert '" + sweep + "'", exercise_in_use().name,
                 "expected the name of one of its sweeps"};
}

FrameStatus PagePlayer::frame(double now_s, const ImageSettings& settings) {
    TrackerReading reading;
    if (hands_->poll(now_s, reading) && !watched_) engine_->observe(reading, false);
    if (watched_) {
        if (watched_->poll(now_s, reading)) engine_->observe(reading, false);
        if (watched_->health().phase == TrackerPhase::ended) watched_.reset();
    }
    if (bundle_.blocks()) bundle_.blocks()->forget_awaited();
    const FrameStatus status = engine_->frame(now_s, settings, pixels_);
    FrameRecord record = engine_->last();
    doppler_.frame(*engine_, record, pixels_, true);
    record.doppler = doppler_.report();
    keep(record, now_s);
    if (session_) session_->observe(record);
    return status;
}

void PagePlayer::frame_unseen(double now_s, const ImageSettings& settings) {
    if (!session_) return;
    TrackerReading reading;
    if (hands_->poll(now_s, reading)) engine_->observe(reading, false);
    unseen_.resize(pixels_.size());
    (void)engine_->frame(now_s, settings, unseen_, true);
    session_->observe(engine_->last());
}

void PagePlayer::keep(const FrameRecord& record, double now_s) {
    looks_at_attempt_ = false;
    // A session's clock starts over, so that time may fall.
    if (kept_last_s_ < 0 || now_s < kept_last_s_ || now_s - kept_last_s_ >= 0.98 / kKeptRate) {
        kept_[kept_next_] = record;
        kept_next_ = (kept_next_ + 1) % kept_.size();
        kept_count_ = std::min(kept_count_ + 1, kept_.size());
        kept_last_s_ = now_s;
    }
    if (!session_) return;
    const double time_s = record.input.time_s;
    if (!attempt_kept_.empty() &&
        time_s - attempt_kept_.back().input.time_s < 0.98 * attempt_step_s_)
        return;
    attempt_kept_.push_back(record);
    if (attempt_kept_.size() < kAttemptMost) return;
    for (std::size_t n = 0; 2 * n < attempt_kept_.size(); ++n)
        attempt_kept_[n] = attempt_kept_[2 * n];
    attempt_kept_.resize((attempt_kept_.size() + 1) / 2);
    attempt_step_s_ *= 2;
}

int PagePlayer::look_at_attempt(double time_s) {
    if (session_ || attempt_kept_.empty()) return -1;
    looks_at_attempt_ = true;
    const auto later = std::upper_bound(
        attempt_kept_.begin(), attempt_kept_.end(), time_s,
        [](double t, const FrameRecord& record) { return t < record.input.time_s; });
    return static_cast<int>(attempt_kept_.end() - std::max(later, attempt_kept_.begin() + 1));
}

const FrameRecord& PagePlayer::kept_record(int back) const {
    assert(kept() > 0);
    const std::size_t n = std::min(std::max(back, 0), kept() - 1);
    if (looks_at_attempt_) return attempt_kept_[attempt_kept_.size() - 1 - n];
    const std::size_t size = kept_.size();
    return kept_[(kept_next_ + 2 * size - 1 - n) % size];
}

FrameStatus PagePlayer::frame_again(int back, const ImageSettings& settings) {
    if (kept() == 0) return FrameStatus::no_contact;
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
    if (kept() == 0) return 0;
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
        const Exercise& written = exercises_[exercise_index_];
        const CaseAnatomy at_rest(bundle_);
        drawn_ = draw_attempt(written, at_rest, bundle_->labels, seed).exercise;
        if (Status made = set_image(image_); !made) {
            drawn_ = before;
            return made;
        }
        hands_ = std::make_unique<MouseTracker>(Skin(*bundle_), *drawn_);
    }
    watched_.reset();
    session_ = std::make_unique<PageSession>(*bundle_, *engine_, trainee, started, seed);
    engine_->begin_session(now_s);
    kept_count_ = 0;
    attempt_kept_.clear();
    attempt_step_s_ = kAttemptStepS;
    looks_at_attempt_ = false;
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
    if (!engine_->last().tools.has_probe || column < 0 || row < 0 || column >= image_.width_px ||
        row >= image_.height_px)
        return {};
    if (!truth_) {
        auto made = TruthRenderer::create(bundle_, exercise_in_use(), engine_->render_options());
        if (!made) return {};
        truth_.emplace(std::move(*made));
    }
    const PixelTruth there = truth_->at(engine_->last().input, column, row);
    if (!there.scanned || there.label <= 0) return {};
    return bundle_->labels[there.label].name;
}

Result<FinishedSession> PagePlayer::finish_attempt() {
    assert(session_);
    if (!is_whole()) return Error{"the case is still loading", "", "scores need all of it"};
    const std::unique_ptr<PageSession> session = std::move(session_);
    return session->finish();
}

}  // namespace sonocase::runtime::inline web
