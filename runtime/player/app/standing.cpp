// SPDX-License-Identifier: Apache-2.0

#include "runtime/player/app/standing.h"

#include <algorithm>
#include <cmath>

#include "formats/scoring/draw_attempt.h"

namespace sonocase::runtime::inline player_app {
namespace {

double metric_of(const ProgressEntry& entry, const std::string& name) {
    for (const Metric& metric : entry.metrics) {
        if (metric.name == name) return metric.value;
    }
    return NAN;
}

}  // namespace

void add_trend(std::span<const ProgressEntry> earlier,
               const SessionScore& score,
               AttemptResult& result) {
    if (result.trend_metric.empty()) return;
    for (const ProgressEntry& entry : earlier) {
        const double value = metric_of(entry, result.trend_metric);
        if (std::isfinite(value)) result.trend.push_back(value);
    }
    const double now = score.value(result.trend_metric);
    if (std::isfinite(now)) result.trend.push_back(now);
    if (result.trend.size() > kMaxTrend)
        result.trend.erase(result.trend.begin(),
                           result.trend.end() - static_cast<std::ptrdiff_t>(kMaxTrend));
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
        constexpr double kSkilled = 0.1, kUnskilled = 0.3;  // shares of failures
        if (!entry.passed) {
            result.in_a_row = 0;
            result.cusum = std::max(0.0, result.cusum + std::log(kSkilled / kUnskilled));
        } else if (attempt_difficulty(entry.seed) >= 0) {
            ++result.in_a_row;
            result.cusum += std::log((1 - kSkilled) / (1 - kUnskilled));
        }
        if (!result.steady && result.cusum >= kSteadyCusum) {
            result.steady = true;
            result.steady_at = entry.started;
        }
        if (!result.mastered && result.in_a_row >= std::max(mastery, 1)) {
            result.mastered = true;
            result.mastered_at = entry.started;
        }
        const double mm = metric_of(entry, "final_tip_to_target_mm");
        if (std::isfinite(mm) && (result.best_mm < 0 || mm < result.best_mm)) result.best_mm = mm;
    }
    return result;
}

}  // namespace sonocase::runtime::inline player_app
