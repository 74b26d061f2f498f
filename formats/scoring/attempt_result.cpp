// SPDX-License-Identifier: Apache-2.0

#include "formats/scoring/attempt_result.h"

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "formats/exercise/metric_table.h"

namespace sonocase {
namespace {

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

constexpr const char* kFindTarget =
    "Find the target first: slide and tilt the probe until it lies in the middle of the picture.";
constexpr const char* kStayInTarget =
    "The needle reached the target and left it: hold it there and end the attempt.";
constexpr const char* kTakeNeedle =
    "Take the needle: put it beside the probe, in the plane of the picture, and aim at the target.";

// What went wrong before any mark could say it: no needle was used, the target was not found, or
// the needle left a target that it had reached. Null: none of these.
const char* earlier_fault(const SessionScore& score) {
    constexpr double kFarMm = 20, kFarLimits = 3;
    for (const PassResult& mark : score.pass_marks) {
        if (mark.metric != "final_tip_to_target_mm" || mark.passed) continue;
        const double mm = mark.value;
        const bool near = mm <= std::max(kFarMm, kFarLimits * mark.at_most);  // false: NaN as well
        if (near) return nullptr;
        if (score.value("targets_hit") > 0) return kStayInTarget;
        const bool found = score.value("targets_scanned_percent") > 0;
        return found && !std::isfinite(mm) ? kTakeNeedle : kFindTarget;
    }
    return nullptr;
}

}  // namespace

AttemptResult attempt_result(const SessionScore& score) {
    AttemptResult result;
    result.marks = static_cast<int>(score.pass_marks.size());
    result.has_marks = result.marks > 0 || score.procedure;
    result.passed = score.passed;
    for (const PassResult& mark : score.pass_marks) {
        result.rows.push_back(row_of(mark));
        result.marks_reached += mark.passed;
    }
    // What was missed most comes first.
    std::stable_sort(result.rows.begin(), result.rows.end(),
                     [](const ResultRow& a, const ResultRow& b) { return miss(a) > miss(b); });
    if (!result.rows.empty()) {
        result.trend_metric = result.rows.front().metric;
        const MetricInfo* info = find_metric(result.trend_metric);
        if (!result.passed && info) result.advice = info->advice;
        if (const char* fault = earlier_fault(score)) result.advice = fault;
    }
    for (const Metric& metric : score.metrics) {
        if (result.rows.size() >= kMaxResults) break;
        const MetricInfo* info = find_metric(metric.name);
        const bool listed = std::any_of(result.rows.begin(), result.rows.end(),
                                        [&](const auto& r) { return r.metric == metric.name; });
        if (!info || listed || !info->evidence[0] || !std::isfinite(metric.value)) continue;
        ResultRow row;
        row.metric = metric.name;
        row.value = metric.value;
        result.rows.push_back(row);
    }
    for (ResultRow& row : result.rows) {
        const MetricInfo* info = find_metric(row.metric);
        row.title = info ? info->title : "";
        place_on_scale(row);
    }
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

}  // namespace sonocase
