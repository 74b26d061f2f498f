// SPDX-License-Identifier: Apache-2.0

#include "runtime/player/app/educator/exam_set.h"

#include <algorithm>
#include <cstdio>

#include "runtime/player/app/attempt_steps.h"
#include "runtime/player/app/case_steps.h"
#include "runtime/player/words/words.h"

namespace sonocase::runtime {
namespace {

const std::string& case_name(const App& app) {
    return app.loaded.open->bundle->manifest.case_name;
}

void start_at(App& app, std::size_t at) {
    ExamSet set = app.scan.exam_set;
    set.at = at;
    set.noted = false;
    choose_exercise(app, set.exercises[at]);
    app.scan.exam_set = set;
    start_attempt(app, "", true);
}

}  // namespace

bool in_exam_set(const App& app, const std::string& exercise) {
    const auto& sets = app.player.settings.exam_sets;
    const auto found = sets.find(case_name(app));
    return found != sets.end() &&
           std::find(found->second.begin(), found->second.end(), exercise) != found->second.end();
}

void toggle_in_exam_set(App& app, const std::string& exercise) {
    std::vector<std::string>& set = app.player.settings.exam_sets[case_name(app)];
    if (std::erase(set, exercise) == 0) set.push_back(exercise);
}

int exam_set_size(const App& app) {
    const auto& exercises = app.loaded.open->exercises;
    return static_cast<int>(
        std::count_if(exercises.begin(), exercises.end(),
                      [&](const Exercise& e) { return in_exam_set(app, e.name); }));
}

void start_exam_set(App& app) {
    if (!app.loaded.open || app.scan.attempt || exam_set_size(app) == 0) return;
    app.scan.exam_set = {};
    const auto& exercises = app.loaded.open->exercises;
    for (std::size_t i = 0; i < exercises.size(); ++i) {
        if (in_exam_set(app, exercises[i].name))
            app.scan.exam_set.exercises.push_back(static_cast<int>(i));
    }
    app.view.dialog = Dialog::none;
    start_at(app, 0);
}

void note_exam_result(App& app) {
    ExamSet& set = app.scan.exam_set;
    if (!exam_set_runs(app) || set.noted || !app.scan.result) return;
    set.passed += app.scan.result->passed;
    set.noted = true;
}

void go_on_with_exam_set(App& app) {
    if (!exam_set_runs(app)) return;
    note_exam_result(app);
    if (app.scan.exam_set.at + 1 < app.scan.exam_set.exercises.size()) {
        start_at(app, app.scan.exam_set.at + 1);
        return;
    }
    app.scan.exam_set = {};
    app.scan.exam = false;
    app.view.page = Page::scan;
}

std::string exam_set_words(const App& app) {
    const ExamSet& set = app.scan.exam_set;
    const int count = static_cast<int>(set.exercises.size());
    char words[96];
    if (static_cast<int>(set.at) + 1 < count || !set.noted) {
        std::snprintf(words, sizeof words, tr("Exam: exercise %d of %d"),
                      static_cast<int>(set.at) + 1, count);
    } else {
        std::snprintf(words, sizeof words, tr("Exam finished: %d of %d passed."), set.passed,
                      count);
    }
    return words;
}

}  // namespace sonocase::runtime
