// SPDX-License-Identifier: Apache-2.0

#include "pipeline/tradeoff/choose_settings.h"

#include <algorithm>
#include <cassert>
#include <cmath>

#include "formats/text/number_text.h"
#include "pipeline/anatomy/analytic_torso.h"
#include "pipeline/base/stopwatch.h"
#include "pipeline/segmentation/resample_labels.h"

namespace sonocase::pipeline::inline tradeoff {
namespace {

double voxel_mm_of(const Settings& settings) {
    for (const Setting& s : settings) {
        double value = 0;
        if (s.key == "resample.voxel_mm" && parse_number(s.value, value)) return value;
    }
    return ResampleOptions{}.voxel_mm;
}

double voxels(double volume_mm3, const Settings& settings) {
    const double h = voxel_mm_of(settings);
    return volume_mm3 / (h * h * h);
}

constexpr double kSame = 0.01;  // errors that differ by less are one

// Whether another row has less error in less time. A case is not tried with such settings.
bool is_beaten(const FrontRow& row, const FrontTable& table) {
    return std::any_of(table.rows.begin(), table.rows.end(), [&](const FrontRow& other) {
        return other.error_mm < row.error_mm && other.seconds < row.seconds;
    });
}

}  // namespace

const FrontTable& measured_front() {
    static const FrontTable table = [] {
        FrontTable t;
        const auto row = [&](const char* settings, double error_mm, double seconds) {
            t.rows.push_back({parse_settings(settings), error_mm, seconds});
        };
#include "pipeline/tradeoff/measured_front.inc"
        return t;
    }();
    return table;
}

CostModel fit_cost_model(const FrontTable& table) {
    // Relative errors count, so each row is weighted by one over the square of its seconds.
    double sw = 0, sx = 0, sxx = 0, sy = 0, sxy = 0;
    for (const FrontRow& row : table.rows) {
        const double x = voxels(table.volume_mm3, row.settings),
                     w = 1 / (row.seconds * row.seconds);
        sw += w;
        sx += w * x;
        sxx += w * x * x;
        sy += w * row.seconds;
        sxy += w * x * row.seconds;
    }
    const double det = sw * sxx - sx * sx;
    CostModel model;
    if (det > 1e-12 * sw * sxx) {
        model.per_voxel_s = std::max(0.0, (sw * sxy - sx * sy) / det);
    }
    model.fixed_s = std::max(0.0, (sy - model.per_voxel_s * sx) / sw);
    return model;
}

std::string format_front(const std::vector<Trial>& trials,
                         const std::string& timed_body,
                         double volume_mm3,
                         double probe_seconds) {
    std::string text =
        "// Written by scripts/accuracy; do not edit. The suite \"case\": settings, greatest error "
        "of the bodies\n"
        "// in mm, seconds on " +
        timed_body + "; the volume of its grid, and the seconds of the probe on that machine.\n";
    text += "t.volume_mm3 = " + number_text(volume_mm3, 6) +
            ";\nt.probe_seconds = " + number_text(probe_seconds, 4) + ";\n";
    const auto of_case = [](const Trial& trial) {
        const bool ours = trial.role == TrialRole::knob || trial.role == TrialRole::pair ||
                          trial.role == TrialRole::preset;
        return trial.suite == "case" && ours;
    };
    for (const Trial& trial : trials) {
        if (!of_case(trial) || trial.body != timed_body) continue;
        double error = trial.error;
        for (const Trial& other : trials)
            if (of_case(other) && other.settings == trial.settings)
                error = std::isfinite(other.error) ? std::max(error, other.error) : NAN;
        // A preset may be a knob's row as well.
        const std::string row = "row(\"" + settings_text(trial.settings) + "\",";
        if (!std::isfinite(error) || text.find(row) != std::string::npos) continue;
        text += row + " " + number_text(error, 4) + ", " + number_text(trial.seconds, 4) + ");\n";
    }
    return text;
}

double probe_seconds() {
    // The stages that take most of a build, on a small torso.
    const Stopwatch watch;
    const LabelVolume ct = sample_analytic_torso(analytic_torso_grid({4, 4, 4}));
    ResampleOptions options;
    options.voxel_mm = 2;
    const Registration truth = analytic_torso_truth();
    (void)resample_labels({ct, truth}, options);
    return watch.seconds();
}

Choice choose_settings(const FrontTable& table,
                       const AccuracyTarget& target,
                       const CaseFigures& figures) {
    assert(!table.rows.empty());
    struct Row {
        const Settings* settings;
        double error_mm, seconds;
    };
    std::vector<Row> rows;  // the cheapest first
    for (const FrontRow& row : table.rows)
        if (!is_beaten(row, table))
            rows.push_back(
                {&row.settings, figures.error_mm(row.settings), figures.seconds(row.settings)});
    std::stable_sort(rows.begin(), rows.end(),
                     [](const Row& a, const Row& b) { return a.seconds < b.seconds; });
    // The cheapest of the best among those that a budget allows.
    const auto best_within = [&](double seconds) {
        const Row* best = nullptr;
        for (const Row& row : rows) {
            if (row.seconds > seconds) break;
            if (best == nullptr || row.error_mm < (1 - kSame) * best->error_mm) best = &row;
        }
        return best;
    };
    const Row* chosen = nullptr;
    Choice choice;
    if (target.tolerance_mm > 0) {
        for (const Row& row : rows) {
            if (chosen == nullptr && row.error_mm <= target.tolerance_mm) chosen = &row;
        }
        if (chosen == nullptr) {
            chosen = best_within(HUGE_VAL);
            choice.warning = "no setting brings this case within " +
                             number_text(target.tolerance_mm, 3) + " mm; the best, " +
                             number_text(chosen->error_mm, 3) + " mm, was taken";
        }
    } else {
        chosen = best_within(target.time_budget_s);
        if (chosen == nullptr) chosen = &rows.front();
    }
    if (target.time_budget_s > 0 && chosen->seconds > target.time_budget_s) {
        choice.warning += (choice.warning.empty() ? "" : "; ") +
                          std::string("the settings chosen take about ") +
                          number_text(chosen->seconds, 2) + " s, more than the " +
                          number_text(target.time_budget_s, 3) + " s given";
    }
    choice.settings = *chosen->settings;
    choice.predicted_error_mm = chosen->error_mm;
    choice.predicted_seconds = chosen->seconds;
    return choice;
}

namespace {

double measure_of(std::span<const StageReport> stages, const char* stage, const char* name) {
    for (const StageReport& report : stages)
        for (const Measure& m : report.measures)
            if (report.stage == stage && m.name == name) return m.value;
    return 0;
}

// The error of the same case with one measure changed; NaN where it has none of that name.
double error_with(std::span<const StageReport> stages,
                  const char* stage,
                  const char* measure,
                  double value) {
    std::vector<StageReport> other(stages.begin(), stages.end());
    bool found = false;
    for (StageReport& report : other)
        for (Measure& m : report.measures) {
            if (report.stage != stage || m.name != measure) continue;
            m.value = value;
            found = true;
        }
    return found ? error_budget(other).known_mm : NAN;
}

constexpr const char* kTwoLandmarks = "two landmarks far apart";

}  // namespace

std::vector<CasePoint> case_points(const FrontTable& table,
                                   std::span<const StageReport> stages,
                                   double volume_mm3) {
    std::vector<CasePoint> points;
    const double now_mm = error_budget(stages).known_mm;
    const double voxel_mm = measure_of(stages, stage_names::kResample, "voxel_mm");
    if (voxel_mm > 0) {
        std::vector<double> edges{voxel_mm};
        for (const FrontRow& row : table.rows) edges.push_back(voxel_mm_of(row.settings));
        std::sort(edges.begin(), edges.end());
        edges.erase(std::unique(edges.begin(), edges.end()), edges.end());
        const auto voxels_of = [&](double h) { return volume_mm3 / (h * h * h); };
        const double per_voxel_s = fit_cost_model(table).per_voxel_s;
        for (const double h : edges)
            points.push_back({"resample.voxel_mm=" + number_text(h, 3),
                              error_with(stages, stage_names::kResample, "voxel_mm", h),
                              per_voxel_s * (voxels_of(h) - voxels_of(voxel_mm)), h == voxel_mm});
    } else {
        points.push_back({"as it is", now_mm, 0, true});
    }
    const double held = measure_of(stages, stage_names::kWarp, "interior_with_two_landmarks_mm");
    if (held > 0)
        points.push_back({kTwoLandmarks,
                          error_with(stages, stage_names::kWarp, "predicted_interior_mm", held), 0,
                          false, true});
    std::stable_sort(points.begin(), points.end(), [](const CasePoint& a, const CasePoint& b) {
        return a.more_seconds < b.more_seconds;
    });
    return points;
}

NextStep next_step(const FrontTable& table,
                   std::span<const StageReport> stages,
                   double volume_mm3) {
    const double now_mm = error_budget(stages).known_mm;
    NextStep step;
    step.error_from_mm = now_mm;
    const std::vector<CasePoint> points = case_points(table, stages, volume_mm3);
    for (const CasePoint& point : points) {
        if (!point.landmarks || !(point.error_mm < (1 - kSame) * now_mm)) continue;
        step.error_to_mm = point.error_mm;
        step.step = std::string(kTwoLandmarks) + " (--landmarks FILE.csv)";
        return step;
    }
    // The first that costs more is the largest voxel that is finer.
    for (const CasePoint& point : points) {
        if (!(point.more_seconds > 0) || !(point.error_mm < (1 - kSame) * now_mm)) continue;
        step.step = point.setting;
        step.error_to_mm = point.error_mm;
        step.more_seconds = point.more_seconds;
        return step;
    }
    return {};
}

}  // namespace sonocase::pipeline::inline tradeoff
