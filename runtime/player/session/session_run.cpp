// SPDX-License-Identifier: Apache-2.0

#include "runtime/player/session/session_run.h"

#include <algorithm>
#include <cstring>
#include <filesystem>
#include <optional>

#include "formats/files/atomic_file.h"
#include "formats/files/load_save.h"
#include "formats/files/thread_jobs.h"
#include "formats/progress_book/progress_book.h"
#include "runtime/engine/scan_engine.h"
#include "runtime/recording/session_words.h"

namespace sonocase::runtime::inline player_session {

std::optional<SessionReplay> session_replay(const std::string& path) {
    const auto sequence = load_sequence(path);
    if (!sequence || sequence->transform_index(kProbeTransform) < 0) return {};
    const auto session = session_from_sequence(*sequence, guess_names(*sequence), path);
    if (!session || session->header.program.empty()) return {};
    SessionReplay replay;
    replay.header = session->header;
    for (const SessionSample& sample : session->samples) {
        replay.settings.push_back(sample.settings);
        replay.times_s.push_back(sample.time_s - session->samples.front().time_s);
    }
    return replay;
}

namespace {

// Why a frame with these events is kept as a picture; null: it is not.
const char* picture_reason(std::span<const LiveEvent> events) {
    for (const LiveEvent& event : events) {
        switch (event.kind) {
            case LiveEventKind::target_hit: return "target_hit";
            case LiveEventKind::no_go_contact: return "no_go_contact";
            case LiveEventKind::needle_entry: return "needle_entry";
            case LiveEventKind::target_scanned: return "target_scanned";
            default: break;
        }
    }
    return nullptr;
}

}  // namespace

SessionRun::SessionRun(const OpenCase& open, const ScanEngine& engine, std::string path)
    : open_(open),
      anatomy_(engine.anatomy()),
      width_px_(engine.render_options().width_px),
      height_px_(engine.render_options().height_px),
      layout_(engine.renderer().layout()),
      exercise_(engine.exercise()),
      path_(std::move(path)),
      monitor_(exercise_, anatomy_.get(), open.bundle->labels) {
    make_room();
}

Result<std::unique_ptr<SessionRun>> SessionRun::start(const std::string& path,
                                                      const OpenCase& open,
                                                      ScanEngine& engine,
                                                      const std::string& trainee,
                                                      const std::string& started,
                                                      double now_s,
                                                      std::uint64_t attempt_seed) {
    std::unique_ptr<SessionRun> run(new SessionRun(open, engine, path));
    SessionHeader header =
        session_header(*open.bundle, run->exercise_, engine.render_options(), trainee, started);
    // An exercise from a file of its own is not in the bundle.
    for (std::size_t i = 0; i < std::min(open.exercises.size(), open.exercise_digests.size());
         ++i) {
        if (open.exercises[i].name == header.exercise)
            header.exercise_digest = open.exercise_digests[i];
    }
    const bool exam = engine.exercise().mode == ExerciseMode::exam;
    if (attempt_seed != 0) {
        header.attempt = "seed=" + std::to_string(attempt_seed) + (exam ? " mode=exam" : "");
    } else if (exam) {
        header.attempt = "mode=exam";
    }
    SONOCASE_TRY(auto recorder,
                 SessionRecorder::start(path, header, run->exercise_, open.bundle->labels));
    run->recorder_ = std::move(recorder);
    engine.begin_session(now_s);
    return run;
}

std::span<const LiveEvent> SessionRun::observe(const FrameRecord& record,
                                               std::span<const std::uint8_t> pixels,
                                               bool may_wait) {
    if (may_wait) recorder_->wait_for_room();
    const FrameInput& input = record.input;
    RecordedFrame frame;
    fill_sample(record, frame);
    const ImageSettings& s = input.settings;
    const bool changed = first_ || s.gain_db != settings_.gain_db ||
                         s.dynamic_range_db != settings_.dynamic_range_db ||
                         s.tgc_db != settings_.tgc_db || s.press_mm != settings_.press_mm ||
                         s.flip_left_right != settings_.flip_left_right ||
                         s.doppler != settings_.doppler;
    if (changed) {
        const std::string text = settings_text(s);  // short, and only while a setting changes
        std::strncpy(frame.settings.data(), text.c_str(), frame.settings.size() - 1);
        settings_ = s;
    }
    first_ = false;
    frame.doppler = record.doppler;
    monitor_.update(frame.time_s, frame.frame, frame.probe_ok, frame.mannequin_from_probe,
                    frame.needle_ok, frame.mannequin_from_drawn, frame.unseen);
    report_punctures(record.puncture, monitor_);
    monitor_.report_procedure(record.new_steps, record.new_complications);
    const auto events = monitor_.events();
    recorder_->push(frame, events);
    if (const char* why = picture_reason(events)) {
        recorder_->push_picture(frame.frame, frame.time_s, why, width_px_, height_px_, pixels,
                                layout_);
    }
    last_ = record;
    follow_deepest(events, pixels);
    return events;
}

void SessionRun::follow_deepest(std::span<const LiveEvent> events,
                                std::span<const std::uint8_t> pixels) {
    constexpr double kDeeperMm = 0.5;  // a slow advance is not copied at every frame
    Deepest& d = deepest_;
    for (const LiveEvent& event : events) {
        if (event.kind == LiveEventKind::needle_exit) d.due = d.depth_mm > 0;
        if (event.kind == LiveEventKind::needle_entry) d.inserted = true;
    }
    if (d.due) push_deepest();
    const double depth_mm = monitor_.depth_mm();
    if (d.due || depth_mm < d.depth_mm + kDeeperMm || pixels.size() > d.pixels.size()) return;
    d.depth_mm = depth_mm;
    d.time_s = last_.input.time_s;
    d.frame = last_.input.frame;
    d.width_px = width_px_;
    d.height_px = height_px_;
    d.layout = layout_;
    std::copy(pixels.begin(), pixels.end(), d.pixels.begin());
}

void SessionRun::push_deepest() {
    Deepest& d = deepest_;
    const auto size = static_cast<std::size_t>(d.width_px) * static_cast<std::size_t>(d.height_px);
    d.due = !recorder_->push_picture(d.frame, d.time_s, "deepest", d.width_px, d.height_px,
                                     std::span(d.pixels).first(size), d.layout);
    if (d.due) return;  // the writer is busy with another; at the next frame again
    d.inserted = false;
    d.depth_mm = 0;
}

Result<SessionScore> SessionRun::finish() {
    if (deepest_.inserted || deepest_.due) {  // the needle stays in, or has just come out
        recorder_->wait_for_room();
        push_deepest();
    }
    SONOCASE_TRY_DONE(recorder_->finish());
    // The file as it is goes before the session is scored: of eight hours it is a gigabyte.
    SONOCASE_TRY(const auto session, [&]() -> Result<Session> {
        const auto sequence = load_sequence(path_);
        if (!sequence) return sequence.error();
        return session_from_sequence(*sequence, guess_names(*sequence), path_);
    }());
    ThreadJobs jobs;
    ScoreOptions options;
    options.jobs = &jobs;
    SessionScore score =
        score_session(session, exercise_, anatomy_.get(), open_.bundle->labels, options);
    if (!session.header.trainee.empty() && !(score.value("elapsed_time_s") >= kMinAttemptS)) {
        score.warnings.push_back("An attempt this short is not put into the progress book.");
    } else if (!session.header.trainee.empty()) {
        // A session that cannot be added to the book still has scores: the trainee sees them, and
        // why.
        std::error_code failed;
        const std::string recording = std::filesystem::absolute(path_, failed).string();
        auto book = ProgressBook::open(default_progress_path());
        Status kept = Done{};
        if (book)
            kept = book->add(progress_entry(session.header, score, failed ? path_ : recording));
        if (!book || !kept) {
            const std::string beside = path_ + ".scores.json";
            const Status written = write_file(beside, score_json(score, exercise_));
            not_kept_ = Message(
                "The session was not put into the progress book: {}. {}",
                {(book ? kept.error() : book.error()).message(),
                 written ? Message("Its scores are in {}; add them later: sonocase progress "
                                   "--add {}",
                                   {beside, beside})
                         : Message("Its scores were not kept either: {}.",
                                   {written.error().message()})});
            score.warnings.push_back(not_kept_);
        }
    }
    return score;
}

}  // namespace sonocase::runtime::inline player_session
