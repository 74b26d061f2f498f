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

// The seconds of a row for a case of another volume. The part that does not depend on voxels stays.
double seconds_at(const FrontRow& row,
                  const FrontTable& table,
                  const CostModel& model,
                  double volume_mm3) {
    const double more = voxels(volume_mm3, row.settings) - voxels(table.volume_mm3, row.settings);
    return std::max(0.1 * row.seconds, row.seconds + model.per_voxel_s * more);
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
                       const std::function<double(const Settings&)>& seconds_of) {
    assert(!table.rows.empty());
    const auto seconds = [&](const FrontRow& row) { return seconds_of(row.settings); };
    std::vector<FrontRow> rows = table.rows;
    std::stable_sort(rows.begin(), rows.end(),
                     [&](const FrontRow& a, const FrontRow& b) { return seconds(a) < seconds(b); });
    const auto best = *std::min_element(
        rows.begin(), rows.end(),
        [](const FrontRow& a, const FrontRow& b) { return a.error_mm < b.error_mm; });
    const FrontRow* chosen = nullptr;
    Choice choice;
    if (target.tolerance_mm > 0) {
        for (const FrontRow& row : rows) {
            if (chosen == nullptr && row.error_mm <= target.tolerance_mm) chosen = &row;
        }
        if (chosen == nullptr) {
            chosen = &best;
            choice.warning =
                "no setting measured comes within " + number_text(target.tolerance_mm, 3) +
                " mm; the best, " + number_text(best.error_mm, 3) +
                " mm, was taken (more readings of the mannequin and thinner CT slices lower it)";
        }
    } else {
        for (const FrontRow& row : rows) {
            if (seconds(row) > target.time_budget_s) continue;
            if (chosen == nullptr || row.error_mm < chosen->error_mm) chosen = &row;
        }
        if (chosen == nullptr) chosen = &rows.front();
    }
    if (target.time_budget_s > 0 && seconds(*chosen) > target.time_budget_s) {
        choice.warning += (choice.warning.empty() ? "" : "; ") +
                          std::string("the settings chosen take about ") +
                          number_text(seconds(*chosen), 2) + " s, more than the " +
                          number_text(target.time_budget_s, 3) + " s given";
    }
    choice.settings = chosen->settings;
    choice.predicted_error_mm = chosen->error_mm;
    choice.predicted_seconds = seconds(*chosen);
    return choice;
}

NextStep next_step(const FrontTable& table, double voxel_mm, double volume_mm3) {
    const CostModel model = fit_cost_model(table);
    const auto seconds = [&](const FrontRow& row) {
        return seconds_at(row, table, model, volume_mm3);
    };
    // The case was cooked with the cheapest of the rows with its voxel.
    const FrontRow* now = nullptr;
    for (const FrontRow& row : table.rows) {
        const double off = std::abs(voxel_mm_of(row.settings) - voxel_mm);
        const double best = now ? std::abs(voxel_mm_of(now->settings) - voxel_mm) : 1e300;
        if (off < best || (off == best && seconds(row) < seconds(*now))) now = &row;
    }
    NextStep step;
    if (now == nullptr) return step;
    const FrontRow* next = nullptr;
    for (const FrontRow& row : table.rows) {
        if (row.error_mm >= now->error_mm * 0.99)
            continue;  // less than a hundredth is not worth a step
        if (next == nullptr || seconds(row) < seconds(*next)) next = &row;
    }
    if (next == nullptr) return step;
    step.settings = settings_text(next->settings);
    step.error_from_mm = now->error_mm;
    step.error_to_mm = next->error_mm;
    step.more_seconds = seconds(*next) - seconds(*now);
    return step;
}

}  // namespace sonocase::pipeline::inline tradeoff
