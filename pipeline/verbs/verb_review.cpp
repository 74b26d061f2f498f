// SPDX-License-Identifier: Apache-2.0

// sonocase review, score and progress: pages, scores and results of recorded sessions.
#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdio>
#include <filesystem>

#include "formats/files/atomic_file.h"
#include "formats/files/load_save.h"
#include "formats/files/thread_jobs.h"
#include "formats/recording/tool_frames.h"
#include "formats/scoring/draw_attempt.h"
#include "formats/text/json_reader.h"
#include "pipeline/import/mesh/surface_file.h"
#include "pipeline/review/review.h"
#include "pipeline/verbs/verb_common.h"
#include "pipeline/verbs/verbs.h"

namespace sonocase::pipeline::inline verbs {

int verb_review(int argc, char** argv) {
    CLI::App app(
        "Make a page of a recorded session: time line, frames, views in space, scores, progress");
    std::string session, bundle, out;
    ReviewOptions options;
    options.progress_path = default_progress_path();
    CommonOptions common;
    bool no_progress = false, keep = false;
    app.add_option("SESSION", session, "The recording (.igs.mha, .igs.nrrd)")->required();
    app.add_option("--case", bundle, "The bundle that it was recorded on")
        ->type_name("BUNDLE")
        ->required();
    app.add_option("-o,--output", out, "Folder for review.html and scores.json")
        ->type_name("DIR")
        ->required();
    app.add_option("--exercise", options.exercise,
                   "Name in the bundle, or a TOML file; default: the session's own");
    app.add_option("--progress", options.progress_path, "Progress book to compare with")
        ->type_name("FILE")
        ->capture_default_str();
    app.add_flag("--no-progress", no_progress, "Compare with nothing");
    app.add_flag("--keep", keep, "Put the session into the progress book");
    options.language = locale_language();
    const auto* language = app.add_option("--language", options.language,
                                          "Of the page: en, de; default: the locale's");
    add_common_options(app, common);
    if (const auto status = parse_command_line(app, argc, argv)) return *status;
    if (language->count() > 0 &&
        !options.language.starts_with(find_language(options.language).code))
        return wrong_usage("review", "--language " + options.language + ": there are en and de");
    if (no_progress) options.progress_path.clear();
    options.threads = common.threads;
    ReviewInput input;
    const auto report = make_review(session, bundle, out, options, &input);
    if (!report) return fail("review", report.error());
    print_warnings("review", *report);
    if (keep && !options.progress_path.empty()) {
        auto book = ProgressBook::open(options.progress_path);
        if (!book) return fail("review", book.error());
        const Status added = book->add(progress_entry(input.session.header, input.score, session));
        if (!added) return fail("review", added.error());
    }
    if (auto s = write_report(common, *report); !s) return fail("review", s.error());
    return kDone;
}

namespace {

struct ScoreArguments {
    std::string session, bundle, body, exercise, probe, needle, axis = "0,0,1";
    bool json = false;
};

std::optional<Vector3> axis_of(const std::string& text) {
    Vector3 v;
    char end = 0;
    if (std::sscanf(text.c_str(), "%lf,%lf,%lf%c", &v.x, &v.y, &v.z, &end) != 3 || !(norm(v) > 0))
        return {};
    return v;
}

void print_scores(const SessionScore& score) {
    for (const Metric& metric : score.metrics) {
        if (std::isfinite(metric.value))
            std::printf("%-34s %.9g\n", metric.name.c_str(), metric.value);
    }
    for (const std::string& warning : score.warnings) std::printf("note: %s\n", warning.c_str());
}

}  // namespace

int verb_score(int argc, char** argv) {
    CLI::App app(
        "Score a recording of this or another trainer: IGSIO sequence, PerkTutor transform log, or "
        "PROBE.csv,NEEDLE.csv");
    ScoreArguments a;
    CommonOptions common;
    app.add_option("SESSION", a.session, "The recording")->required();
    app.add_option("--case", a.bundle, "Bundle that gives body and exercise")->type_name("BUNDLE");
    auto* body = app.add_option("--body", a.body,
                                "Closed mesh of the tissue in the recording's frame, in the place "
                                "of a bundle's body")
                     ->type_name("MESH");
    body->excludes("--case");
    app.add_option("--exercise", a.exercise, "Name in the bundle, or a TOML file");
    app.add_option("--probe", a.probe,
                   "Transform of the probe, e.g. ProbeToReference; default: guessed");
    app.add_option("--needle", a.needle, "Transform of the needle; default: guessed");
    app.add_option("--needle-axis", a.axis, "From hub to tip in the needle's frame")
        ->capture_default_str();
    app.add_flag("--json", a.json, "As JSON, in the documented form");
    add_common_options(app, common);
    if (const auto status = parse_command_line(app, argc, argv)) return *status;
    const auto axis = axis_of(a.axis);
    if (!axis) return wrong_usage("score", "--needle-axis is not a direction x,y,z");
    const auto session = [&]() -> Result<Session> {
        SONOCASE_TRY(const auto sequence, load_recording_file(a.session));
        SessionNames names = guess_names(sequence);
        names.needle_axis = *axis;
        if (!a.probe.empty()) names.probe = a.probe;
        if (!a.needle.empty()) names.needle = names.drawn = a.needle;
        const TransformName probe = split_transform_name(names.probe);
        if (!names.probe.empty() && names.needle.empty())
            for (const std::string& other : sequence.transforms)
                if (const auto from = split_transform_name(other).from;
                    from != probe.from && from != probe.to)
                    std::fprintf(stderr,
                                 "sonocase score: note: %s is not scored: if it is the needle, "
                                 "give --needle %s\n",
                                 other.c_str(), other.c_str());
        return session_from_sequence(sequence, names, a.session);
    }();
    if (!session) return fail("score", session.error());
    if (session->samples.empty())
        return fail("score", Error{"holds no reading", a.session, "expected poses with times"});
    if (const auto status = check_session(*session, a.session); !status)
        return fail("score", status.error());
    for (const Message& note : session->notes)
        std::fprintf(stderr, "sonocase score: note: %s\n", note.c_str());
    CaseBundle bundle;
    std::vector<Message> warnings;
    if (!a.bundle.empty()) {
        auto loaded = load_bundle(a.bundle);
        if (!loaded) return fail("score", loaded.error());
        bundle = std::move(*loaded);
    }
    auto found = find_review_exercise(bundle, a.exercise, session->header.exercise, warnings);
    if (!found) return fail("score", found.error());
    Exercise& exercise = found->exercise;
    for (const Message& warning : mismatch_warnings(session->header, bundle, a.exercise, exercise))
        warnings.push_back(warning);
    if (const std::uint64_t seed = attempt_seed(session->header); seed != 0 && !a.bundle.empty()) {
        const CaseAnatomy at_rest(bundle);
        exercise = draw_attempt(exercise, at_rest, bundle.labels, seed).exercise;
    }
    std::unique_ptr<Anatomy> anatomy;
    if (!a.body.empty()) {
        auto mesh = import_surface(a.body, {.torso = false});
        if (!mesh) return fail("score", mesh.error());
        if (mesh->triangles.empty()) {
            return fail("score", Error{"holds points and no triangles", a.body, "a closed mesh"});
        }
        anatomy = std::make_unique<MeshAnatomy>(std::move(*mesh));
    } else if (!a.bundle.empty()) {
        anatomy = std::make_unique<CaseAnatomy>(bundle, breathing_shown(exercise, session->header));
    }
    ScoreOptions options;
    ThreadJobs jobs(common.threads);
    options.jobs = &jobs;
    SessionScore score = score_session(*session, exercise, anatomy.get(), bundle.labels, options);
    if (!a.bundle.empty())
        score.warnings.insert(score.warnings.begin(), warnings.begin(), warnings.end());
    const std::string json = score_json(score, exercise);
    if (a.json) {
        std::fputs(json.c_str(), stdout);
    } else {
        print_scores(score);
    }
    if (!common.report_path.empty()) {
        if (auto s = write_file(common.report_path, json); !s) return fail("score", s.error());
    }
    return kDone;
}

namespace {

// A session whose scores the player kept beside its recording, because the book could not be
// written: RECORDING.scores.json.
Result<ProgressEntry> kept_entry(const std::string& path) {
    const std::string ending = ".scores.json";
    if (!path.ends_with(ending))
        return Error{"is not a file of kept scores", path, "expected RECORDING.scores.json"};
    const std::string recording = path.substr(0, path.size() - ending.size());
    SONOCASE_TRY(const Sequence sequence, load_recording_file(recording));
    SONOCASE_TRY(const Session session,
                 session_from_sequence(sequence, guess_names(sequence), recording));
    if (session.header.trainee.empty())
        return Error{"names no trainee", recording, "only sessions of a trainee are kept"};
    SONOCASE_TRY(const std::string text, read_text_file(path));
    detail::Json scores;
    detail::JsonFault fault{path, {}};
    if (!detail::parse_json(text, scores, fault)) return *fault.error;
    if (!scores.is_object() || !scores.contains("metrics") || !scores["metrics"].is_object())
        return Error{"holds no metrics", path, "expected what sonoplay wrote beside a recording"};
    SessionScore score;
    score.passed = scores.value("passed", false);
    for (const auto& [name, value] : scores["metrics"].items()) {
        if (value.is_number()) score.metrics.push_back({name, value.get<double>()});
    }
    if (scores.contains("procedure") && scores["procedure"].contains("items")) {
        ProcedureResult& list = score.procedure.emplace();
        for (const auto& item : scores["procedure"]["items"]) {
            ProcedureResult::Item& line = list.items.emplace_back();
            line.name = item.value("name", "");
            line.critical = item.value("critical", false);
            line.ticked = item.value("ticked", false);
        }
    }
    std::error_code failed;
    const std::string whole = std::filesystem::absolute(recording, failed).string();
    return progress_entry(session.header, score, failed ? recording : whole);
}

// Spaces up to a column, counted in characters and not in bytes of UTF-8.
std::string padded(std::string text, std::ptrdiff_t wide) {
    const auto characters =
        std::count_if(text.begin(), text.end(), [](char c) { return (c & 0xC0) != 0x80; });
    text.append(static_cast<std::size_t>(std::max<std::ptrdiff_t>(wide - characters, 0)), ' ');
    return text;
}

}  // namespace

int verb_progress(int argc, char** argv) {
    CLI::App app("What trainees have done so far: list, export, remove");
    std::string path = default_progress_path(), trainee, exercise, csv, remove;
    CommonOptions common;
    app.add_option("--progress", path, "The progress book")
        ->type_name("FILE")
        ->capture_default_str();
    app.add_option("--trainee", trainee, "Only this one");
    app.add_option("--exercise", exercise, "Only this one");
    std::vector<std::string> kept;
    app.add_option("--add", kept,
                   "Add sessions whose scores were kept beside their recordings, because the book "
                   "could not be written")
        ->type_name("RECORDING.scores.json");
    app.add_option("--csv", csv, "Write the sessions with all scores")->type_name("FILE.csv");
    app.add_option("--remove", remove, "Remove a trainee with all sessions and recordings")
        ->type_name("NAME");
    add_common_options(app, common);
    if (const auto status = parse_command_line(app, argc, argv)) return *status;
    auto book = ProgressBook::open(path);
    if (!book) return fail("progress", book.error());
    for (const std::string& file : kept) {
        const auto entry = kept_entry(file);
        if (!entry) return fail("progress", entry.error());
        if (auto s = book->add(*entry); !s) return fail("progress", s.error());
        std::printf("added %s: %s, %s\n", entry->started.c_str(), entry->trainee.c_str(),
                    entry->exercise.c_str());
    }
    if (!kept.empty()) return kDone;
    if (!remove.empty()) {
        const auto removed = book->remove_trainee(remove);
        if (!removed) return fail("progress", removed.error());
        for (const std::string& file : removed->not_deleted) {
            std::fprintf(stderr, "sonocase progress: warning: could not delete %s\n", file.c_str());
        }
        std::printf("removed %s: sessions %zu, recordings %zu, review pages %zu\n", remove.c_str(),
                    removed->sessions, removed->recordings, removed->reviews);
        return kDone;
    }
    if (!trainee.empty()) {
        if (auto s = book->expect_trainee(trainee); !s) return fail("progress", s.error());
    }
    if (!csv.empty()) {
        const auto text = book->csv(trainee, exercise);
        if (!text) return fail("progress", text.error());
        // Spreadsheets take a table for Latin-1 unless it begins with the mark of UTF-8.
        const bool ascii = std::all_of(text->begin(), text->end(),
                                       [](char c) { return static_cast<unsigned char>(c) < 128; });
        if (auto s = write_file(csv, (ascii ? "" : "\xEF\xBB\xBF") + *text); !s)
            return fail("progress", s.error());
        return kDone;
    }
    const auto sessions = book->sessions(trainee, exercise);
    if (!sessions) return fail("progress", sessions.error());
    for (const ProgressEntry& e : *sessions) {
        double error = NAN;
        for (const Metric& m : e.metrics) {
            if (m.name == "final_tip_to_target_mm") error = m.value;
        }
        std::printf("%s  %s %s %-10s", e.started.c_str(), padded(e.trainee, 20).c_str(),
                    padded(e.exercise, 24).c_str(), e.passed ? "passed" : "not passed");
        if (std::isfinite(error)) std::printf("  tip to target %.1f mm", error);
        std::printf("\n");
    }
    return kDone;
}

}  // namespace sonocase::pipeline::inline verbs
