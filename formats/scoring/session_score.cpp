// SPDX-License-Identifier: Apache-2.0

#include "formats/scoring/session_score.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <sstream>

#include "formats/exercise/metric_table.h"
#include "formats/scoring/score_parts.h"
#include "formats/scoring/sight.h"
#include "formats/text/json_reader.h"

namespace sonocase {
namespace {

using detail::MetricValues;
using detail::ScoreInput;

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

void score_times(const ScoreInput& input, MetricValues& values, std::vector<Message>& warnings) {
    double first = INFINITY, last = -INFINITY;
    for (const ToolTrack* track : {&input.probe, &input.needle}) {
        if (track->points.empty()) continue;
        first = std::min(first, track->points.front().time_s);
        last = std::max(last, track->points.back().time_s);
    }
    if (first <= last) values["elapsed_time_s"] = last - first;
    if (!input.needle.points.empty()) values["tracking_gap_s"] = input.needle.longest_gap_s;
    const std::size_t back = input.probe.run_back + input.needle.run_back;
    if (back > 0) {
        warnings.push_back(
            {"{} readings were left out, because their time ran backwards or their "
             "pose was not finite.",
             {std::to_string(back)}});
    }
    if (!input.anatomy)
        warnings.push_back("No body was given, so scores that need one are undefined.");
}

SessionCurves curves_of(const ScoreInput& input) {
    SessionCurves c;
    for (std::size_t i = 0; i < input.readings.size(); ++i) {
        const NeedleReading& r = input.readings[i];
        c.time_s.push_back(input.time(i));
        c.depth_mm.push_back(input.anatomy ? std::max(r.depth_mm, 0.0) : kNan);
        c.plane_distance_mm.push_back(r.plane_mm);
        c.in_beam_fraction.push_back(r.seen && r.in_sector_mm > 0 ? r.in_beam_mm / r.in_sector_mm
                                                                  : kNan);
        double nearest = kNan;
        // With many targets the curve of the nearest one says little and is expensive.
        if (input.exercise.targets.size() <= 64) {
            for (std::size_t t = 0; t < input.exercise.targets.size(); ++t) {
                const double d = distance(input.target_at(t, input.time(i)), input.tip(i));
                if (!(d >= nearest)) nearest = d;
            }
        }
        c.tip_to_target_mm.push_back(nearest);
    }
    return c;
}

// Sets the metrics in the order of their table, and the pass marks.
void fill_metrics(const Exercise& exercise, const MetricValues& values, SessionScore& out) {
    for (const MetricInfo& info : metric_table()) {
        const auto found = values.find(info.name);
        out.metrics.push_back({info.name, found == values.end() ? kNan : found->second});
    }
    for (const Exercise::PassMark& mark : exercise.pass_marks) {
        PassResult result{.metric = mark.metric,
                          .value = out.value(mark.metric),
                          .at_most = mark.at_most,
                          .at_least = mark.at_least};
        result.passed = result.value <= mark.at_most && result.value >= mark.at_least;  // NaN fails
        out.passed = out.passed && result.passed;
        out.pass_marks.push_back(std::move(result));
    }
}

detail::Json procedure_json(const ProcedureResult& result) {
    using detail::Json;
    using detail::json_number;
    const auto when = [](double time_s) { return time_s < 0 ? Json(nullptr) : Json(time_s); };
    Json out = Json::object();
    out["passed"] = result.passed;
    out["points"] = result.points;
    out["cut"] = result.cut;
    out["max_points"] = result.max_points;
    Json steps = Json::array(), items = Json::array(), complications = Json::array(),
         taken = Json::array();
    for (const ProcedureResult::Step& step : result.steps) {
        Json row = Json::object();
        row["name"] = step.name;
        row["state"] = step_state_name(step.state);
        row["time_s"] = when(step.time_s);
        steps.push_back(std::move(row));
    }
    for (const ProcedureResult::Item& item : result.items) {
        Json row = Json::object();
        row["name"] = item.name;
        row["title"] = item.title;
        row["critical"] = item.critical;
        row["weight"] = item.weight;
        row["ticked"] = item.ticked;
        row["time_s"] = when(item.time_s);
        if (!item.ticked) row["why"] = item.why;
        if (!item.source.empty()) row["source"] = item.source;
        items.push_back(std::move(row));
    }
    for (const ProcedureResult::Happened& one : result.complications) {
        Json row = Json::object();
        row["name"] = one.name;
        row["time_s"] = one.time_s;
        complications.push_back(std::move(row));
    }
    for (const ProcedureResult::Taken& one : result.taken) {
        Json row = Json::object();
        row["region"] = one.region;
        row["mm"] = one.mm;
        taken.push_back(std::move(row));
    }
    out["steps"] = std::move(steps);
    out["items"] = std::move(items);
    out["complications"] = std::move(complications);
    out["taken"] = std::move(taken);
    out["stray_acts"] = result.stray_acts;
    out["stray_acts_at_most"] = result.stray_acts_at_most;
    out["injected_ml"] = json_number(result.injected_ml);
    out["aspirated_ml"] = json_number(result.aspirated_ml);
    out["drained_ml"] = json_number(result.drained_ml);
    out["bled_ml"] = json_number(result.bled_ml);
    return out;
}

}  // namespace

double SessionScore::value(std::string_view name) const {
    for (const Metric& metric : metrics) {
        if (metric.name == name) return metric.value;
    }
    return kNan;
}

SessionScore score_session(const Session& session,
                           const Exercise& exercise,
                           const Anatomy* anatomy,
                           const std::vector<Label>& labels,
                           const ScoreOptions& options) {
    ScoreInput input{session,
                     exercise,
                     anatomy,
                     options,
                     track_of(session, Tool::probe),
                     track_of(session, Tool::drawn_needle),
                     {}};
    input.readings = look_up_readings(session, input.needle, exercise, anatomy, labels, options);
    const bool has_no_go = std::any_of(labels.begin(), labels.end(), [&](const Label& label) {
        return std::count(exercise.no_go.begin(), exercise.no_go.end(), label.name) > 0;
    });
    MetricValues values;
    SessionScore out;
    score_times(input, values, out.warnings);
    detail::score_motion("needle_", input.needle, options.motion, values);
    detail::score_motion("probe_", input.probe, options.motion, values);
    const bool has_needle = !input.needle.points.empty(), has_probe = !input.probe.points.empty();
    if (has_needle || has_probe) out.targets.resize(exercise.targets.size());
    if (has_needle) {
        detail::score_tissue(input, has_no_go, values, out.warnings);
        out.insertions = detail::find_insertions(input);
        if (anatomy) values["insertions"] = static_cast<double>(out.insertions.size());
        detail::score_targets_hit(input, out.insertions, values, out.targets);
        detail::score_guidance(input, values);
    }
    detail::score_probe_use(input, values);
    detail::score_targets_scanned(input, values, out.targets);
    detail::score_press(input, values);
    detail::score_doppler(input, values);
    out.curves = curves_of(input);
    fill_metrics(exercise, values, out);
    out.procedure = procedure_result(session, exercise, anatomy, labels);
    if (out.procedure) out.passed = out.passed && out.procedure->passed;
    return out;
}

std::string score_json(const SessionScore& score, const Exercise& exercise) {
    using detail::Json;
    using detail::json_number;
    using detail::json_of;
    Json out = Json::object();
    out["exercise"] = exercise.name;
    out["sight_rule"] = kSightRule;
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
        item["target"] = s.target < 0 ? Json(nullptr) : Json(exercise.targets[s.target].name);
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
    out["warnings"] = std::vector<std::string>(score.warnings.begin(), score.warnings.end());
    if (score.procedure) out["procedure"] = procedure_json(*score.procedure);
    return detail::json_text(out, true) + "\n";
}

BreathingMotion breathing_shown(const Exercise& exercise,
                                bool physical_model,
                                const std::vector<std::string>& effects) {
    // A list of nothing but removals starts from all effects, any other list from none.
    bool on = std::all_of(effects.begin(), effects.end(),
                          [](const std::string& e) { return !e.empty() && e[0] == '-'; });
    for (const std::string& e : effects) on = on || e == "auto" || e == "all";
    for (const std::string& e : effects) {
        if (e == "breathing") on = true;
        if (e == "-breathing") on = false;
    }
    return physical_model && on ? exercise.breathing : BreathingMotion{};
}

BreathingMotion breathing_shown(const Exercise& exercise, const SessionHeader& header) {
    std::vector<std::string> effects;
    std::istringstream words(detail_value(header.render, "effects"));
    for (std::string word; std::getline(words, word, ',');) effects.push_back(word);
    return breathing_shown(exercise, detail_value(header.render, "model") == "physical", effects);
}

}  // namespace sonocase
