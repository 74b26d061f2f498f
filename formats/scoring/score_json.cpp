// SPDX-License-Identifier: Apache-2.0

#include "formats/scoring/session_score.h"
#include "formats/text/json_reader.h"

namespace sonocase {

std::string score_json(const SessionScore& score, const Exercise& exercise) {
    using detail::Json;
    using detail::json_number;
    using detail::json_of;
    Json out = Json::object();
    out["exercise"] = exercise.name;
    Json metrics = Json::object();
    for (const Metric& metric : score.metrics) metrics[metric.name] = json_number(metric.value);
    out["metrics"] = std::move(metrics);
    out["passed"] = score.passed;
    Json marks = Json::array();
    for (const PassResult& result : score.pass_marks) {
        Json item = Json::object();
        item["metric"] = result.metric;
        item["value"] = json_number(result.value);
        item["at_most"] = json_number(result.at_most);
        item["at_least"] = json_number(result.at_least);
        item["passed"] = result.passed;
        marks.push_back(std::move(item));
    }
    out["pass_marks"] = std::move(marks);
    Json insertions = Json::array();
    for (const InsertionScore& s : score.insertions) {
        Json item = Json::object();
        item["entry_s"] = s.entry_s;
        item["exit_s"] = s.exit_s;
        item["still_in"] = s.still_in;
        item["entry"] = json_of(s.entry);
        item["entry_direction"] = json_of(s.entry_direction);
        item["deepest_mm"] = s.deepest_mm;
        item["deepest_s"] = s.deepest_s;
        item["final_tip"] = json_of(s.final_tip);
        item["target"] = s.target < 0
                             ? Json(nullptr)
                             : Json(exercise.targets[static_cast<std::size_t>(s.target)].name);
        item["tip_to_target_mm"] = json_number(s.tip_to_target_mm);
        insertions.push_back(std::move(item));
    }
    out["insertions"] = std::move(insertions);
    Json targets = Json::array();
    for (std::size_t t = 0; t < score.targets.size(); ++t) {
        const auto when = [](double time_s) { return time_s < 0 ? Json(nullptr) : Json(time_s); };
        Json item = Json::object();
        item["name"] = exercise.targets[t].name;
        item["first_hit_s"] = when(score.targets[t].first_hit_s);
        item["first_scanned_s"] = when(score.targets[t].first_scanned_s);
        item["first_seen_s"] = when(score.targets[t].first_seen_s);
        targets.push_back(std::move(item));
    }
    out["targets"] = std::move(targets);
    out["warnings"] = score.warnings;
    return detail::json_text(out, true) + "\n";
}

}  // namespace sonocase
