// SPDX-License-Identifier: Apache-2.0

// Where the millimetres of a case's error come from, according to the reports of its stages.
//
// Every entry is a mean displacement of surfaces, so that entries can be compared, and added as
// the root of the sum of squares, since their causes are independent. A fit of skins says nothing
// of what is deep in the body; that entry has no number, except where the map is known (the
// analytic torso).
#pragma once

#include <cstddef>
#include <span>
#include <string>
#include <vector>

#include "formats/base/stage_report.h"

namespace sonocase::pipeline {

struct BudgetEntry {
    std::string stage;  // whose error it is
    std::string cause;
    double mm = 0;      // mean displacement of surfaces; NaN: unknown
    std::string basis;  // how the number was obtained
};

struct ErrorBudget {
    std::vector<BudgetEntry> entries;  // in the order of the stages
    double known_mm = 0;               // of the entries with a number
};

// What would lower the error next, and what it would cost; from the measured settings
// (pipeline/tradeoff/choose_settings.h).
struct NextStep {
    std::string settings;  // "resample.voxel_mm=1"; empty: nothing measured is better
    double error_from_mm = 0;
    double error_to_mm = 0;
    double more_seconds = 0;  // on the machine of the sweep
};

// An entry is left out where its stage did not report what it is computed from.
ErrorBudget error_budget(std::span<const StageReport> stages);

// Mean displacement of surfaces through a map that is known, as a share of the map's own voxel
// (cube root of its volume) and of the cooked voxel: measured on the analytic torso
// (tests/pipeline/tradeoff/error_budget_test.cpp repeats it).
inline constexpr double kSampledShare = 0.085;
inline constexpr double kCookedShare = 0.05;

}  // namespace sonocase::pipeline
