// SPDX-License-Identifier: Apache-2.0

#include "formats/scoring/course_standing.h"

#include <algorithm>
#include <chrono>
#include <climits>
#include <cmath>
#include <cstdio>

#include "formats/scoring/draw_attempt.h"

namespace sonocase {
namespace {

double metric_of(const ProgressEntry& entry, const std::string& name) {
    for (const Metric& metric : entry.metrics) {
        if (metric.name == name) return metric.value;
    }
    return NAN;
}

// The day of an ISO 8601 time, moved on by some days; empty: it does not begin with a date.
std::string day_of(const std::string& time, int later = 0) {
    int year = 0, month = 0, day = 0;
    if (std::sscanf(time.c_str(), "%4d-%2d-%2d", &year, &month, &day) != 3) return {};
    const std::chrono::year_month_day given{std::chrono::year{year},
                                            std::chrono::month{static_cast<unsigned>(month)},
                                            std::chrono::day{static_cast<unsigned>(day)}};
    if (!given.ok()) return {};
    const std::chrono::year_month_day moved{std::chrono::sys_days{given} +
                                            std::chrono::days{later}};
    char text[32];
    std::snprintf(text, sizeof text, "%04d-%02u-%02u", static_cast<int>(moved.year()),
                  static_cast<unsigned>(moved.month()), static_cast<unsigned>(moved.day()));
    return text;
}

ModuleStanding standing_in(const CourseModule& module,
                           std::span<const ProgressEntry> history,
                           const std::string& today) {
    ModuleStanding now;
    std::vector<ProgressEntry> counted;
    for (const ProgressEntry& entry : history) {
        if (entry.case_name != module.case_name || entry.exercise != module.exercise) continue;
        for (const Metric& metric : entry.metrics)
            if (metric.name == module.measure) now.measured = metric.value;
        if (!module.gate.exam || entry.exam) counted.push_back(entry);
    }
    now.in_limits = now.measured >= module.at_least && now.measured <= module.at_most;
    const CourseGate& gate = module.gate;
    now.attempts = standing(counted, module.case_name, module.exercise,
                            gate.passes_in_a_row > 0 ? gate.passes_in_a_row : INT_MAX);
    std::string passed;
    if (gate.passes_in_a_row > 0 && now.attempts.mastered) passed = now.attempts.mastered_at;
    if (gate.steady && now.attempts.steady &&
        (!now.attempts.mastered || gate.passes_in_a_row == 0 || now.attempts.steady_at < passed))
        passed = now.attempts.steady_at;
    now.passed =
        (gate.passes_in_a_row > 0 && now.attempts.mastered) || (gate.steady && now.attempts.steady);
    if (!now.passed) return now;
    now.passed_on = day_of(passed);
    if (module.retention_days == 0) return now;
    now.due_on = day_of(passed, module.retention_days);
    if (now.due_on.empty()) return now;
    for (const ProgressEntry& entry : counted) {
        const std::string day = day_of(entry.started);
        if (entry.passed && attempt_difficulty(entry.seed) >= 0 && day >= now.due_on &&
            now.kept_on.empty())
            now.kept_on = day;
    }
    now.due = now.kept_on.empty() && day_of(today) >= now.due_on;
    return now;
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

CourseStanding course_standing(const Course& course,
                               std::span<const ProgressEntry> history,
                               std::span<const CourseAnswer> answers,
                               const std::string& today) {
    CourseStanding now;
    bool open = true;
    for (const CourseModule& module : course.modules) {
        ModuleStanding one = standing_in(module, history, today);
        for (const CourseAnswer& answer : answers)
            if (answer.course == course.name && answer.module == module.name &&
                answer.option < static_cast<int>(module.options.size()))
                one.option = answer.option;
        one.open = open;
        open = open && one.passed;
        now.passed += one.passed;
        now.due += one.due;
        now.modules.push_back(std::move(one));
    }
    for (std::size_t i = 0; i < now.modules.size() && now.next < 0; ++i)
        if (now.modules[i].due) now.next = static_cast<int>(i);
    for (std::size_t i = 0; i < now.modules.size() && now.next < 0; ++i)
        if (!now.modules[i].passed) now.next = static_cast<int>(i);
    return now;
}

}  // namespace sonocase
