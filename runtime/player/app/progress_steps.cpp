// SPDX-License-Identifier: Apache-2.0

#include "runtime/player/app/progress_steps.h"

#include <cmath>
#include <filesystem>

namespace sonocase::runtime {

void sign_in(App& app, const std::string& name) {
    PlayerState& player = app.player;
    player.trainee = name;
    player.settings.trainee = name;
    player.history.clear();
    std::error_code ignored;
    if (!std::filesystem::exists(default_progress_path(), ignored)) return;
    auto book = ProgressBook::open(default_progress_path());
    if (!book) {
        app.view.notices.warning(book.error().message());
        return;
    }
    if (auto names = book->trainees()) player.trainees = std::move(*names);
    if (name.empty()) return;
    auto sessions = book->sessions(name, "");
    if (!sessions) {
        app.view.notices.warning(sessions.error().message());
        return;
    }
    player.history = std::move(*sessions);
}

void note_attempt(App& app, const std::string& started) {
    const SessionScore& score = *app.scan.score;
    const std::string& case_name = app.loaded.open->bundle->manifest.case_name;
    const std::string& exercise = app.loaded.exercise().name;
    std::vector<ProgressEntry> earlier;
    for (const ProgressEntry& entry : app.player.history) {
        if (entry.case_name == case_name && entry.exercise == exercise) earlier.push_back(entry);
    }
    app.scan.result = attempt_result(score, earlier);
    app.view.class_records.reset();
    // A slip of the hand is not an attempt; the progress book leaves it out too.
    constexpr double kLeastAttemptS = 3;
    if (!(score.value("elapsed_time_s") >= kLeastAttemptS)) return;
    ProgressEntry entry;
    entry.trainee = app.player.trainee;
    entry.case_name = case_name;
    entry.exercise = exercise;
    entry.started = started;
    entry.recording = app.scan.score_file;
    entry.passed = score.passed;
    entry.seed = app.loaded.attempt_seed;
    for (const Metric& metric : score.metrics) {
        if (std::isfinite(metric.value)) entry.metrics.push_back(metric);
    }
    app.player.history.push_back(std::move(entry));
}

}  // namespace sonocase::runtime
