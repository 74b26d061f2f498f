// SPDX-License-Identifier: Apache-2.0

#include "runtime/player/app/exam_set.h"

#include <algorithm>
#include <cstdio>

#include "runtime/player/app/attempt_steps.h"
#include "runtime/player/app/case_steps.h"
#include "runtime/player/words/words.h"

namespace sonocase::runtime::inline player_app {
namespace {

void start_at(PlayerState& player, CaseState& loaded, ScanState& scan, std::size_t at) {
    ExamSet set = scan.training.exam_set;
    set.at = at;
    set.noted = false;
    choose_exercise(player, loaded, scan, set.exercises[at]);
    scan.training.exam_set = set;
    start_attempt(player, loaded, scan, "", true);
}

}  // namespace

bool in_exam_set(const Settings& settings, const CaseState& loaded, const std::string& exercise) {
    const auto& sets = settings.exam_sets;
    const auto found = sets.find(loaded.name());
    return found != sets.end() &&
           std::find(found->second.begin(), found->second.end(), exercise) != found->second.end();
}

void toggle_in_exam_set(Settings& settings, const CaseState& loaded, const std::string& exercise) {
    std::vector<std::string>& set = settings.exam_sets[loaded.name()];
    if (std::erase(set, exercise) == 0) set.push_back(exercise);
}

int exam_set_size(const Settings& settings, const CaseState& loaded) {
    const auto& exercises = loaded.open->exercises;
    return static_cast<int>(
        std::count_if(exercises.begin(), exercises.end(),
                      [&](const Exercise& e) { return in_exam_set(settings, loaded, e.name); }));
}

void start_exam_set(PlayerState& player, CaseState& loaded, ScanState& scan) {
    if (!loaded.open || scan.training.attempt || exam_set_size(player.settings, loaded) == 0)
        return;
    scan.training.exam_set = {};
    const auto& exercises = loaded.open->exercises;
    for (std::size_t i = 0; i < exercises.size(); ++i) {
        if (in_exam_set(player.settings, loaded, exercises[i].name))
            scan.training.exam_set.exercises.push_back(static_cast<int>(i));
    }
    start_at(player, loaded, scan, 0);
}

void note_exam_result(Training& training) {
    ExamSet& set = training.exam_set;
    if (!set.runs() || set.noted || !training.result) return;
    set.passed += training.result->passed;
    set.noted = true;
}

void go_on_with_exam_set(PlayerState& player, CaseState& loaded, ScanState& scan) {
    Training& training = scan.training;
    if (!training.exam_set.runs()) return;
    note_exam_result(training);
    if (training.exam_set.at + 1 < training.exam_set.exercises.size()) {
        start_at(player, loaded, scan, training.exam_set.at + 1);
        return;
    }
    training.exam_set = {};
    training.exam = false;
}

std::string exam_set_words(const ExamSet& set) {
    const int count = static_cast<int>(set.exercises.size());
    if (static_cast<int>(set.at) + 1 < count || !set.noted)
        return filled(tr("Exam: exercise %d of %d"), static_cast<int>(set.at) + 1, count);
    return filled(tr("Exam finished: %d of %d passed."), set.passed, count);
}

}  // namespace sonocase::runtime::inline player_app
