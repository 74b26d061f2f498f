// SPDX-License-Identifier: Apache-2.0

#include "runtime/player/training/attempt_result.h"

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "formats/attempt/difficulty.h"
#include "formats/exercise/metric_table.h"

namespace sonocase::runtime {
namespace {

bool begins(const std::string& text, const char* with) {
    return text.rfind(with, 0) == 0;
}

bool is_share(const std::string& metric) {
    constexpr std::string_view kEnd = "_fraction";
    return metric.size() > kEnd.size() &&
           metric.compare(metric.size() - kEnd.size(), kEnd.size(), kEnd) == 0;
}

// How far a missed mark was missed, relative to its limit.
double miss(const ResultRow& row) {
    if (!row.has_limit || row.reached) return 0;
    if (!std::isfinite(row.value)) return 1e9;
    const double scale = std::max(std::abs(row.limit), 1e-3);
    return std::abs(row.value - row.limit) / scale;
}

void place_on_scale(ResultRow& row) {
    double high = std::isfinite(row.value) ? row.value : 0;
    if (row.has_limit) high = std::max(high, row.limit);
    double end = is_share(row.metric) ? 1 : 1.35 * high;
    if (!(end > 0)) end = 1;
    row.value_at =
        static_cast<float>(std::clamp(std::isfinite(row.value) ? row.value / end : 0.0, 0.0, 1.0));
    row.limit_at = static_cast<float>(std::clamp(row.limit / end, 0.0, 1.0));
}

ResultRow row_of(const PassResult& mark) {
    ResultRow row;
    row.metric = mark.metric;
    row.value = mark.value;
    row.has_limit = true;
    row.at_least = !std::isfinite(mark.at_most);
    row.limit = row.at_least ? mark.at_least : mark.at_most;
    row.reached = mark.passed;
    return row;
}

double metric_of(const ProgressEntry& entry, const std::string& name) {
    for (const Metric& metric : entry.metrics) {
        if (metric.name == name) return metric.value;
    }
    return NAN;
}

}  // namespace

// The first beginning that fits.
const char* advice_for(const std::string& metric) {
    static constexpr struct {
        const char *begins, *advice;
    } kAdvice[] = {
        {"no_go",
         "Before you advance, look for vessels and bowel on the way, and choose another "
         "entry if they lie on it."},
        {"posterior_wall",
         "Stop as soon as the tip shows inside the vessel, and flatten the "
         "needle before you go on."},
        {"vessels_shown",
         "Tilt the probe along the vessel or steer the box until beam and flow are off a "
         "right angle."},
        {"vessels_measured", "Lay the gate into each vessel and hold still for two heartbeats."},
        {"correct_vessel_measured",
         "Tell artery from vein by colour and pulse before you lay the gate."},
        {"gate_in_vessel", "Lay the gate into the middle of the vessel, no longer than its lumen."},
        {"doppler_angle",
         "Tilt the probe or steer until beam and flow are less than 60 degrees "
         "apart."},
        {"angle_cursor", "Turn the angle cursor until it lies along the vessel."},
        {"peak_velocity", "Turn the angle cursor until it lies along the vessel."},
        {"correct_vessel",
         "Press gently before you puncture: a vein closes, an artery keeps its "
         "shape."},
        {"tip_in_view",
         "Stop pushing as soon as the tip fades; fan the probe until it is bright, "
         "then go on."},
        {"needle_in_beam",
         "Turn the probe until the whole shaft lies in the picture, then "
         "advance."},
        {"needle_plane", "Turn the probe until the whole shaft lies in the picture, then advance."},
        {"targets_scanned", "Slide the probe over the whole organ before you choose an entry."},
        {"structures_scanned", "Slide the probe over the whole organ before you choose an entry."},
        {"targets_hit",
         "Go on until the tip lies in the middle of the target, and check it by "
         "rocking the probe."},
        {"final_tip",
         "Stop in the middle of the target: rock the probe over the tip before you "
         "finish."},
        {"targeting_error",
         "Stop in the middle of the target: rock the probe over the tip before "
         "you finish."},
        {"final_angle", "Aim at the target before the needle enters the skin."},
        {"trajectory", "Aim at the target before the needle enters the skin, and keep the line."},
        {"insertions", "Aim outside the skin first; correct the angle before the needle enters."},
        {"skin_contacts",
         "Aim outside the skin first; correct the angle before the needle "
         "enters."},
        {"tissue_punctures",
         "Aim outside the skin first; correct the angle before the needle "
         "enters."},
        {"path_in_tissue",
         "Go straight to the target; pull back to the skin before you change "
         "direction."},
        {"tissue_damage",
         "Go straight to the target; pull back to the skin before you change "
         "direction."},
        {"depth_perception", "Read the depth of the target from the scale before you advance."},
        {"elapsed_time", "Plan the path before the needle enters, then advance without pauses."},
        {"time_in_tissue", "Plan the path before the needle enters, then advance without pauses."},
        {"probe_force", "Hold the probe with less pressure: tissue and veins keep their shape."},
        {"probe_pressure", "Hold the probe with less pressure: tissue and veins keep their shape."},
        {"press_time", "Hold the probe with less pressure: tissue and veins keep their shape."},
        {"needle_",
         "Hold the probe still while the needle moves, and the needle still while you "
         "look."},
        {"probe_",
         "Hold the probe still while the needle moves, and the needle still while you "
         "look."},
    };
    for (const auto& entry : kAdvice) {
        if (begins(metric, entry.begins)) return entry.advice;
    }
    return "";
}

AttemptResult attempt_result(const SessionScore& score, std::span<const ProgressEntry> earlier) {
    AttemptResult result;
    result.marks = static_cast<int>(score.pass_marks.size());
    result.has_marks = result.marks > 0;
    result.passed = score.passed;
    for (const PassResult& mark : score.pass_marks) {
        result.rows.push_back(row_of(mark));
        result.marks_reached += mark.passed;
    }
    // A mark that was missed is never among those that do not fit.
    std::stable_sort(result.rows.begin(), result.rows.end(),
                     [](const ResultRow& a, const ResultRow& b) { return miss(a) > miss(b); });
    if (!result.rows.empty()) {
        result.trend_metric = result.rows.front().metric;
        if (!result.passed) result.advice = advice_for(result.trend_metric);
    }
    for (const Metric& metric : score.metrics) {
        if (result.rows.size() >= kMostResults) break;
        const MetricInfo* info = find_metric(metric.name);
        const bool listed = std::any_of(result.rows.begin(), result.rows.end(),
                                        [&](const auto& r) { return r.metric == metric.name; });
        if (!info || listed || !info->evidence[0] || !std::isfinite(metric.value)) continue;
        ResultRow row;
        row.metric = metric.name;
        row.value = metric.value;
        result.rows.push_back(row);
    }
    if (result.rows.size() > kMostResults) result.rows.resize(kMostResults);
    for (ResultRow& row : result.rows) {
        const MetricInfo* info = find_metric(row.metric);
        row.title = info ? info->title : "";
        place_on_scale(row);
    }
    if (result.trend_metric.empty()) return result;
    for (const ProgressEntry& entry : earlier) {
        const double value = metric_of(entry, result.trend_metric);
        if (std::isfinite(value)) result.trend.push_back(value);
    }
    const double now = score.value(result.trend_metric);
    if (std::isfinite(now)) result.trend.push_back(now);
    if (result.trend.size() > kMostTrend)
        result.trend.erase(result.trend.begin(),
                           result.trend.end() - static_cast<std::ptrdiff_t>(kMostTrend));
    return result;
}

std::string metric_words(const std::string& metric, double value) {
    if (!std::isfinite(value)) return "–";
    char words[48];
    if (is_share(metric)) {
        std::snprintf(words, sizeof words, "%.0f %%", 100 * value);
        return words;
    }
    const std::string unit = metric_unit(metric);
    if (unit == "s" && value >= 60) {
        const int whole = static_cast<int>(std::lround(value));
        std::snprintf(words, sizeof words, "%d:%02d", whole / 60, whole % 60);
        return words;
    }
    const bool whole = std::abs(value - std::round(value)) < 1e-9 || std::abs(value) >= 100;
    std::snprintf(words, sizeof words, whole ? "%.0f" : "%.1f", value);
    return unit.empty() ? words : std::string(words) + " " + (unit == "percent" ? "%" : unit);
}

Standing standing(std::span<const ProgressEntry> entries,
                  const std::string& case_name,
                  const std::string& exercise,
                  int mastery) {
    Standing result;
    for (const ProgressEntry& entry : entries) {
        if (entry.case_name != case_name || entry.exercise != exercise) continue;
        ++result.attempts;
        result.passes += entry.passed;
        if (!entry.passed)
            result.in_a_row = 0;
        else if (attempt_difficulty(entry.seed) >= 0)
            ++result.in_a_row;
        result.mastered = result.mastered || result.in_a_row >= std::max(mastery, 1);
        const double mm = metric_of(entry, "final_tip_to_target_mm");
        if (std::isfinite(mm) && (result.best_mm < 0 || mm < result.best_mm)) result.best_mm = mm;
    }
    return result;
}

}  // namespace sonocase::runtime
