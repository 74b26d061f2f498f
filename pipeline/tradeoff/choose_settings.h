// SPDX-License-Identifier: Apache-2.0

// Chooses settings for a wanted accuracy, or for the time available.
//
// The settings to choose from are those of the table (measured_front.inc, written by
// scripts/accuracy from a sweep of the whole case on the synthetic bodies). Error and seconds are
// those of the case at hand, which the caller gives. The seconds of the next step in a bundle must
// not depend on the machine: they are those of the sweep, by a cost per voxel that is fitted to the
// table.
#pragma once

#include <functional>
#include <span>
#include <string>
#include <vector>

#include "formats/base/result.h"
#include "pipeline/export/error_budget.h"
#include "pipeline/tradeoff/sweep.h"

namespace sonocase::pipeline::inline tradeoff {

struct FrontRow {
    Settings settings;
    double error_mm = 0;  // mean displacement of surfaces, the worst of the bodies swept
    double seconds = 0;   // for the demo torso, on the machine of the sweep
};

struct FrontTable {
    std::vector<FrontRow> rows;
    double volume_mm3 = 0;     // of the demo torso's cooked grid
    double probe_seconds = 1;  // of the probe on the machine of the sweep
};
const FrontTable& measured_front();

// seconds = a + b voxels by least squares over the rows; both >= 0.
struct CostModel {
    double fixed_s = 0;
    double per_voxel_s = 0;
};
CostModel fit_cost_model(const FrontTable& table);

// The text of measured_front.inc from sweeps of the suite "case": every setting that was tried on
// all bodies, with the largest of its errors and its seconds on `timed_body`, whose grid has
// volume_mm3.
std::string format_front(const std::vector<Trial>& trials,
                         const std::string& timed_body,
                         double volume_mm3,
                         double probe_seconds);

// Seconds of a fixed piece of the pipeline's own work on this machine, with the threads now
// allowed.
double probe_seconds();

struct AccuracyTarget {
    double tolerance_mm = 0;   // > 0: the cheapest settings whose error is within
    double time_budget_s = 0;  // > 0: the best settings whose time is within; both: tolerance first
};

struct Choice {
    Settings settings;
    double predicted_error_mm = 0;
    double predicted_seconds = 0;
    std::string warning;  // the part of the target that cannot be achieved; empty: none
};

// What the case at hand has with given settings.
struct CaseFigures {
    std::function<double(const Settings&)> error_mm;
    std::function<double(const Settings&)> seconds;  // of the whole command
};

// Errors that differ by less than a hundredth count as one: of those the cheapest is taken. The
// table has at least one row.
Choice choose_settings(const FrontTable& table,
                       const AccuracyTarget& target,
                       const CaseFigures& figures);

// The case's error with every voxel that the table has and with two landmarks, where its fit says
// what they would bring; by seconds, the case as it is among them.
std::vector<CasePoint> case_points(const FrontTable& table,
                                   std::span<const StageReport> stages,
                                   double volume_mm3);

// What would lower the error of a case by a hundredth or more, by its own reports: two landmarks,
// where its fit has none and says what they would bring; otherwise the largest voxel of the table
// that does. volume_mm3  of its grid
NextStep next_step(const FrontTable& table, std::span<const StageReport> stages, double volume_mm3);

}  // namespace sonocase::pipeline::inline tradeoff
