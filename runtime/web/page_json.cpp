// SPDX-License-Identifier: Apache-2.0

#include "runtime/web/page_json.h"

#include "formats/exercise/metric_table.h"
#include "formats/text/json_reader.h"

namespace sonocase::runtime::inline web {
namespace {

using detail::Json;

Json json_of_exercise(const Exercise& exercise) {
    Json out = Json::object();
    out["name"] = exercise.name;
    out["title"] = exercise.title;
    out["description"] = exercise.description;
    out["kind"] = exercise.kind;
    out["difficulty"] = exercise.difficulty;
    out["mode"] = exercise.mode == ExerciseMode::exam ? "exam" : "practice";
    out["hints"] = exercise.hints;
    // Whether an attempt draws targets or start anew, for which the whole case is needed.
    bool drawn = exercise.start_spread_mm > 0;
    for (const Target& lesion : shown_lesions(exercise)) drawn = drawn || lesion.spread_mm > 0;
    drawn = drawn || !exercise.findings.empty();
    out["drawn"] = drawn;
    Json targets = Json::array();
    for (const Target& target : exercise.targets) targets.push_back(target.name);
    out["targets"] = std::move(targets);
    Json marks = Json::array();
    for (const Exercise::PassMark& mark : exercise.pass_marks) {
        Json item = Json::object();
        item["metric"] = mark.metric;
        item["at_most"] = detail::json_number(mark.at_most);
        item["at_least"] = detail::json_number(mark.at_least);
        marks.push_back(std::move(item));
    }
    out["pass_marks"] = std::move(marks);
    return out;
}

}  // namespace

std::string case_json(const PagePlayer& player) {
    Json out = Json::object();
    out["case_name"] = player.bundle()->manifest.case_name;
    Json exercises = Json::array();
    for (const Exercise& exercise : player.exercises())
        exercises.push_back(json_of_exercise(exercise));
    out["exercises"] = std::move(exercises);
    Json labels = Json::array();
    for (const Label& label : player.bundle()->labels) labels.push_back(label.name);
    out["labels"] = std::move(labels);
    out["warnings"] = player.warnings();
    return detail::json_text(out, false);
}

std::string metric_words_json() {
    Json out = Json::array();
    for (const MetricInfo& info : metric_table()) {
        Json item = Json::object();
        item["name"] = info.name;
        item["group"] = info.group;
        item["title"] = info.title;
        item["unit"] = metric_unit(info.name);
        out.push_back(std::move(item));
    }
    return detail::json_text(out, false);
}

}  // namespace sonocase::runtime::inline web
