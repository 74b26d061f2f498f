// SPDX-License-Identifier: Apache-2.0

#include "runtime/player/app/kept/class_records.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <nlohmann/json.hpp>
#include <set>

#include "runtime/player/words/words.h"

namespace sonocase::runtime {
namespace {

constexpr int kMastery = 3;       // where an exercise says nothing else
constexpr int kManyAttempts = 3;  // without a pass: help is due

}  // namespace

Standing ClassRecords::standing(const std::string& trainee, const std::string& exercise) const {
    std::vector<ProgressEntry> own;
    for (const ProgressEntry& entry : entries) {
        if (entry.trainee != trainee || entry.exercise != exercise) continue;
        own.push_back(entry);
        own.back().case_name.clear();  // the exercise counts, on whichever case
    }
    return runtime::standing(own, "", exercise, kMastery);
}

ClassRecords make_class_records(std::vector<ProgressEntry> entries,
                                const std::set<std::string>& experts) {
    ClassRecords records;
    records.entries = std::move(entries);
    std::set<std::string> trainees, exercises;
    for (const ProgressEntry& entry : records.entries) {
        trainees.insert(entry.trainee);
        exercises.insert(entry.exercise);
        for (const Metric& metric : entry.metrics) {
            if (metric.name == "final_tip_to_target_mm" && std::isfinite(metric.value))
                records.curves[entry.trainee].push_back(metric.value);
        }
    }
    records.trainees.assign(trainees.begin(), trainees.end());
    records.exercises.assign(exercises.begin(), exercises.end());
    for (const std::string& exercise : records.exercises)
        records.reliability[exercise] = exercise_reliability(records.entries, exercise, experts);
    for (const std::string& trainee : records.trainees) {
        for (const std::string& exercise : records.exercises) {
            const Standing now = records.standing(trainee, exercise);
            if (now.attempts < kManyAttempts || now.passes > 0 || !records.sentence.empty())
                continue;
            char words[256];
            std::snprintf(words, sizeof words,
                          tr("%s may need help with %s: %d attempts, no pass."), trainee.c_str(),
                          exercise.c_str(), now.attempts);
            records.sentence = words;
        }
    }
    return records;
}

std::string xapi_json(std::span<const ProgressEntry> entries) {
    using nlohmann::json;
    json all = json::array();
    for (const ProgressEntry& entry : entries) {
        json extensions = json::object();
        for (const Metric& metric : entry.metrics)
            extensions["https://sonocase.org/xapi/measure/" + metric.name] = metric.value;
        all.push_back(
            {{"actor",
              {{"objectType", "Agent"},
               {"account", {{"homePage", "https://sonocase.org"}, {"name", entry.trainee}}}}},
             {"verb",
              {{"id", entry.passed ? "http://adlnet.gov/expapi/verbs/passed"
                                   : "http://adlnet.gov/expapi/verbs/failed"},
               {"display", {{"en", entry.passed ? "passed" : "failed"}}}}},
             {"object",
              {{"objectType", "Activity"},
               {"id", "https://sonocase.org/xapi/exercise/" + entry.exercise},
               {"definition", {{"name", {{"en", entry.exercise}}}}}}},
             {"result", {{"success", entry.passed}, {"extensions", extensions}}},
             {"context", {{"extensions", {{"https://sonocase.org/xapi/case", entry.case_name}}}}},
             {"timestamp", entry.started}});
    }
    // A name need not be UTF-8.
    return all.dump(1, ' ', false, json::error_handler_t::replace) + "\n";
}

}  // namespace sonocase::runtime
