// SPDX-License-Identifier: Apache-2.0

// Where the millimetres of a case's error come from, according to the reports of its stages.
//
// Every entry is a mean displacement of surfaces, so that entries can be compared. Their causes are
// independent, so they are added as the root of the sum of squares. A fit of skins says nothing
// about the depth of the body; that entry has no number.
#pragma once

#include <cstddef>
#include <span>
#include <string>
#include <vector>

#include "formats/base/stage_report.h"

namespace sonocase::pipeline::inline exporting {

struct BudgetEntry {
    std::string stage;  // the stage that causes it
    std::string cause;
    double mm = 0;      // mean displacement of surfaces; NaN: unknown
    std::string basis;  // how the number was obtained
};

struct ErrorBudget {
    std::vector<BudgetEntry> entries;  // in the order of the stages
    double known_mm = 0;               // of the entries with a number
};

// The setting that would lower the error next, and its cost; from the measured settings
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

}  // namespace sonocase::pipeline::inline exporting
