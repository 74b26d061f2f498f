// SPDX-License-Identifier: Apache-2.0

#include "runtime/player/app/class_records.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <map>
#include <set>

#include <nlohmann/json.hpp>

#include "runtime/player/words/words.h"

namespace sonocase::runtime::inline player_app {

namespace {

double mean(std::span<const double> values) {
    double sum = 0;
    for (const double v : values) sum += v;
    return sum / static_cast<double>(values.size());
}

double variance(std::span<const double> values) {
    const double middle = mean(values);
    double sum = 0;
    for (const double v : values) sum += (v - middle) * (v - middle);
    return sum / static_cast<double>(values.size() - 1);
}

// Where two normal densities are equal, between their means.
double crossing(double m1, double v1, double m2, double v2) {
    constexpr double kSame = 1e-9;
    if (std::abs(v1 - v2) <= kSame * (v1 + v2)) return 0.5 * (m1 + m2);
    // (x - m1)^2 / v1 + ln v1 = (x - m2)^2 / v2 + ln v2
    const double a = 1 / v1 - 1 / v2, b = -2 * (m1 / v1 - m2 / v2),
                 c = m1 * m1 / v1 - m2 * m2 / v2 + std::log(v1 / v2);
    const double root = std::sqrt(std::max(b * b - 4 * a * c, 0.0));
    for (const double x : {(-b + root) / (2 * a), (-b - root) / (2 * a)}) {
        if (x >= std::min(m1, m2) && x <= std::max(m1, m2)) return x;
    }
    return NAN;  // one group's curve lies over the other's everywhere between the means
}

double tip_to_target(const ProgressEntry& entry) {
    for (const Metric& metric : entry.metrics) {
        if (metric.name == "final_tip_to_target_mm") return metric.value;
    }
    return NAN;
}

}  // namespace

double cronbach_alpha(const std::vector<std::vector<double>>& rows) {
    if (rows.size() < 2 || rows[0].size() < 2) return NAN;
    const std::size_t items = rows[0].size();
    std::vector<double> sums(rows.size(), 0.0);
    double of_items = 0;
    for (std::size_t i = 0; i < items; ++i) {
        std::vector<double> item;
        for (std::size_t r = 0; r < rows.size(); ++r) {
            item.push_back(rows[r][i]);
            sums[r] += rows[r][i];
        }
        of_items += variance(item);
    }
    const double of_sums = variance(sums);
    if (!(of_sums > 0)) return NAN;
    const auto k = static_cast<double>(items);
    return k / (k - 1) * (1 - of_items / of_sums);
}

ContrastingGroups contrasting_groups(std::span<const double> experts,
                                     std::span<const double> novices) {
    ContrastingGroups groups;
    groups.experts = static_cast<int>(experts.size());
    groups.novices = static_cast<int>(novices.size());
    if (experts.size() < 2 || novices.size() < 2) return groups;
    const double good = mean(experts), poor = mean(novices);
    const double v1 = variance(experts), v2 = variance(novices);
    if (!(good < poor) || !(v1 > 0) || !(v2 > 0)) return groups;
    groups.mark = crossing(good, v1, poor, v2);
    if (!std::isfinite(groups.mark)) return groups;
    const auto share = [&](std::span<const double> values, auto&& counts) {
        return static_cast<double>(std::count_if(values.begin(), values.end(), counts)) /
               static_cast<double>(values.size());
    };
    groups.experts_failed = share(experts, [&](double v) { return v > groups.mark; });
    groups.novices_passed = share(novices, [&](double v) { return v <= groups.mark; });
    return groups;
}

ExerciseReliability exercise_reliability(std::span<const ProgressEntry> entries,
                                         const ClassExercise& exercise,
                                         const std::set<std::string>& experts) {
    std::map<std::string, std::vector<double>> results;
    for (const ProgressEntry& entry : entries) {
        const double mm = tip_to_target(entry);
        if (entry.exercise == exercise.name && entry.case_name == exercise.case_name &&
            std::isfinite(mm))
            results[entry.trainee].push_back(mm);
    }
    ExerciseReliability found;
    std::vector<std::vector<double>> rows;
    std::vector<double> good, poor;
    for (const auto& [trainee, mm] : results) {
        if (mm.size() >= kAlphaAttempts) rows.emplace_back(mm.begin(), mm.begin() + kAlphaAttempts);
        if (experts.count(trainee)) {
            good.insert(good.end(), mm.begin(), mm.end());
        } else {
            poor.push_back(mm.front());
        }
    }
    found.trainees = static_cast<int>(rows.size());
    found.alpha = cronbach_alpha(rows);
    found.groups = contrasting_groups(good, poor);
    return found;
}

namespace {

constexpr int kMastery = 3;       // where an exercise says nothing else
constexpr int kManyAttempts = 3;  // without a pass: help is due

}  // namespace

Standing ClassRecords::standing(const std::string& trainee, const ClassExercise& exercise) const {
    std::vector<ProgressEntry> own;
    for (const ProgressEntry& entry : entries)
        if (entry.trainee == trainee) own.push_back(entry);
    return sonocase::standing(own, exercise.case_name, exercise.name, kMastery);
}

std::vector<double> ClassRecords::curve(const std::string& trainee,
                                        const ClassExercise& exercise) const {
    std::vector<double> all;
    for (const ProgressEntry& entry : entries) {
        const double mm = tip_to_target(entry);
        if (entry.trainee == trainee && entry.exercise == exercise.name &&
            entry.case_name == exercise.case_name && std::isfinite(mm))
            all.push_back(mm);
    }
    return all;
}

std::vector<ChecklistRow> ClassRecords::checklist(const std::string& trainee,
                                                  const ClassExercise& exercise) const {
    const auto counts = [&](const ProgressEntry& entry) {
        return entry.exercise == exercise.name && entry.case_name == exercise.case_name &&
               !entry.items.empty() && (trainee.empty() || entry.trainee == trainee);
    };
    std::vector<ChecklistRow> rows;
    const auto last = std::find_if(entries.rbegin(), entries.rend(), counts);
    if (last == entries.rend()) return rows;
    for (const CheckedItem& item : last->items)
        rows.push_back({item.name, item.critical, 0, 0, item.ticked});
    for (const ProgressEntry& entry : entries) {
        if (!counts(entry)) continue;
        for (const CheckedItem& item : entry.items) {
            for (ChecklistRow& row : rows) {
                if (row.name != item.name) continue;
                ++row.attempts;
                row.ticked += item.ticked;
            }
        }
    }
    return rows;
}

ClassRecords make_class_records(std::vector<ProgressEntry> entries,
                                const std::set<std::string>& experts,
                                const Course* course,
                                const std::string& today) {
    ClassRecords records;
    records.entries = std::move(entries);
    std::set<std::string> trainees;
    std::set<ClassExercise> exercises;
    for (const ProgressEntry& entry : records.entries) {
        trainees.insert(entry.trainee);
        exercises.insert({entry.case_name, entry.exercise});
    }
    records.trainees.assign(trainees.begin(), trainees.end());
    records.exercises.assign(exercises.begin(), exercises.end());
    for (const std::string& trainee : records.trainees) {
        if (!course) break;
        std::vector<ProgressEntry> own;
        for (const ProgressEntry& entry : records.entries)
            if (entry.trainee == trainee) own.push_back(entry);
        records.course[trainee] = course_standing(*course, own, {}, today);
    }
    for (const ClassExercise& exercise : records.exercises)
        records.reliability[exercise] = exercise_reliability(records.entries, exercise, experts);
    for (const std::string& trainee : records.trainees) {
        for (const ClassExercise& exercise : records.exercises) {
            const Standing now = records.standing(trainee, exercise);
            if (now.attempts < kManyAttempts || now.passes > 0 || !records.help.trainee.empty())
                continue;
            records.help = {trainee, exercise, now.attempts};
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
        for (const CheckedItem& item : entry.items)
            extensions["https://sonocase.org/xapi/item/" + item.name] = item.ticked;
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

}  // namespace sonocase::runtime::inline player_app
