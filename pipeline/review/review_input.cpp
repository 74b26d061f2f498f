// SPDX-License-Identifier: Apache-2.0

#include "pipeline/review/review_input.h"

#include <filesystem>

#include "formats/base/digest.h"
#include "formats/files/atomic_file.h"
#include "formats/files/load_save.h"
#include "formats/files/thread_jobs.h"
#include "formats/scoring/draw_attempt.h"
#include "formats/text/nearest_name.h"

namespace sonocase::pipeline::inline review {
namespace {

std::string pictures_of(const std::string& session_path) {
    const std::string ending = ".igs.mha";
    if (session_path.size() <= ending.size() ||
        session_path.compare(session_path.size() - ending.size(), ending.size(), ending) != 0) {
        return "";
    }
    return session_path.substr(0, session_path.size() - ending.size()) + ".frames.igs.mha";
}

}  // namespace

Result<ReviewedExercise> find_review_exercise(const CaseBundle& bundle,
                                              const std::string& wanted,
                                              const std::string& named_by_session,
                                              std::vector<Message>& warnings) {
    const auto parsed = [](const std::string& toml,
                           const std::string& where) -> Result<ReviewedExercise> {
        SONOCASE_TRY(auto exercise, parse_exercise(toml, where));
        SONOCASE_TRY(auto texts, parse_exercise_texts(toml, where));
        return ReviewedExercise{std::move(exercise), std::move(texts)};
    };
    if (wanted.find(".toml") != std::string::npos) {
        SONOCASE_TRY(const auto text, read_text_file(wanted));
        return parsed(text, wanted);
    }
    const std::string name = wanted.empty() ? named_by_session : wanted;
    std::vector<std::string> names;
    for (const EmbeddedExercise& embedded : bundle.exercises) {
        if (embedded.name == name) return parsed(embedded.toml, "exercise " + name);
        names.push_back(embedded.name);
    }
    if (!wanted.empty()) {
        return Error{"the case has no exercise '" + wanted + "'", "", suggest_name(wanted, names)};
    }
    if (!name.empty()) {
        warnings.push_back(
            {"The case has no exercise '{}': the session is shown without targets "
             "and pass marks.",
             {name}});
    }
    Exercise free_scan;
    free_scan.name = name;
    free_scan.title = "Free scan";
    free_scan.kind = "scan";
    return ReviewedExercise{std::move(free_scan), {}};
}

std::vector<Message> mismatch_warnings(const SessionHeader& header,
                                       const CaseBundle& bundle,
                                       const std::string& wanted,
                                       const Exercise& exercise) {
    std::vector<Message> warnings;
    if (!header.case_name.empty() && header.case_name != bundle.manifest.case_name) {
        warnings.push_back({"The session was recorded on the case '{}' and not on '{}'.",
                            {header.case_name, bundle.manifest.case_name}});
    }
    if (!header.exercise.empty() && header.exercise != exercise.name) {
        warnings.push_back({"The session was recorded for the exercise '{}' and not for '{}'.",
                            {header.exercise, exercise.name}});
    }
    if (!wanted.empty() || header.exercise_digest.empty()) return warnings;
    for (const EmbeddedExercise& embedded : bundle.exercises) {
        if (embedded.name == header.exercise &&
            digest_of(embedded.toml) != header.exercise_digest) {
            warnings.push_back(
                "The exercise was changed after this session: the marks are today's.");
        }
    }
    return warnings;
}

Result<ReviewInput> load_review(const std::string& session_path,
                                const std::string& bundle_path,
                                const ReviewOptions& options) {
    ReviewInput input;
    input.session_path = session_path;
    input.language = &find_language(options.language);
    // The file as read, a gigabyte for eight hours, is freed before the session is evaluated.
    SONOCASE_TRY(auto session, [&]() -> Result<Session> {
        const auto sequence = load_recording_file(session_path);
        if (!sequence) return sequence.error();
        return session_from_sequence(*sequence, guess_names(*sequence), session_path);
    }());
    if (const auto status = check_session(session, session_path); !status)
        input.warnings.push_back({"The session cannot be judged: {}.", {status.error().message()}});
    for (const Message& note : session.notes) input.warnings.push_back(note);
    input.session = std::move(session);
    if (input.session.samples.empty()) {
        return Error{"holds no reading", session_path, "record a session with sonoplay --record"};
    }
    SONOCASE_TRY(auto bundle, load_bundle(bundle_path));
    input.bundle = std::move(bundle);
    const SessionHeader& header = input.session.header;
    SONOCASE_TRY(const auto reviewed, find_review_exercise(input.bundle, options.exercise,
                                                           header.exercise, input.warnings));
    for (const Message& warning :
         mismatch_warnings(header, input.bundle, options.exercise, reviewed.exercise))
        input.warnings.push_back(warning);
    const CaseAnatomy at_rest(input.bundle);
    AttemptDraw drawn =
        draw_attempt(reviewed.exercise, at_rest, input.bundle.labels, attempt_seed(header));
    input.exercise = std::move(drawn.exercise);
    input.texts = texts_in(input.exercise, reviewed.texts, input.language->code);
    input.warnings.insert(input.warnings.end(), drawn.warnings.begin(), drawn.warnings.end());
    const CaseAnatomy anatomy(input.bundle, breathing_shown(input.exercise, header));
    ScoreOptions score;
    ThreadJobs jobs(options.threads);
    score.jobs = &jobs;
    input.score =
        score_session(input.session, input.exercise, &anatomy, input.bundle.labels, score);
    const std::string pictures = pictures_of(session_path);
    if (!pictures.empty() && std::filesystem::exists(pictures)) {
        auto kept = load_sequence(pictures);
        if (kept && kept->element == "MET_UCHAR" && kept->channels == 1 && kept->depth == 1) {
            input.pictures = std::move(*kept);
        } else {
            input.warnings.push_back(
                {"The kept frames could not be read: {}.",
                 {kept ? Message("they are no grey pictures") : kept.error().message()}});
        }
    }
    if (!options.progress_path.empty() && !header.trainee.empty() &&
        std::filesystem::exists(options.progress_path)) {
        SONOCASE_TRY(const auto book, ProgressBook::open(options.progress_path));
        SONOCASE_TRY(const auto all, book.sessions(header.trainee, header.exercise));
        for (const ProgressEntry& entry : all) {
            if (entry.started < header.started) input.earlier.push_back(entry);
        }
    }
    return input;
}

}  // namespace sonocase::pipeline::inline review
