// SPDX-License-Identifier: Apache-2.0

// Where the millimetres of a case's error come from, according to the reports of its stages.
//
// Every entry is a mean displacement of surfaces, so that entries can be compared. Their causes are
// independent, so they are added as the root of the sum of squares.
#pragma once

#include <cstddef>
#include <span>
#include <string>
#include <vector>

#include "formats/base/stage_report.h"
#include "formats/bundle/case_bundle.h"

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

// What would lower this case's error next, and its cost (pipeline/tradeoff/choose_settings.h).
struct NextStep {
    std::string step;  // "resample.voxel_mm=1", "two landmarks far apart"; empty: nothing does
    double error_from_mm = 0;
    double error_to_mm = 0;
    double more_seconds = 0;  // > 0, on the machine of the sweep; of landmarks 0
};

// What the case's error would be with another setting, and what that would take: both of this case.
struct CasePoint {
    std::string setting;      // "resample.voxel_mm=1"
    double error_mm = 0;      // known part of its budget
    double more_seconds = 0;  // than the case as it is, on the machine of the sweep
    bool present = false;     // the case as it is
    bool landmarks = false;   // two landmarks far apart, everything else as it is
};

// How far from its true place a structure may lie on the mannequin, by what the fit reports.
struct UnknownPlace {
    std::string label;
    double p90_mm = 0;             // nine times in ten it lies nearer
    double with_landmarks_mm = 0;  // the same if two landmarks were given; 0: that is not known
    bool target = false;           // a target of an exercise lies in it
};

// Worst first; empty where the case's map was not fitted.
std::vector<UnknownPlace> unknown_places(std::span<const StageReport> stages);

// Those in which a target lies before the others, either worst first.
std::vector<UnknownPlace> unknown_places_of_case(const CaseBundle& bundle);

// "two landmarks far apart would bring liver from 11 to 3 mm": the structure that they help most,
// with a target where they help one of those. Empty where they bring none nearer by a tenth.
std::string landmark_advice(std::span<const UnknownPlace> places);

// An entry is left out where its stage did not report what it is computed from.
ErrorBudget error_budget(std::span<const StageReport> stages);

// Mean displacement of surfaces through a map that is known, as a share of the map's own voxel
// (cube root of its volume) and of the cooked voxel: measured on the analytic torso
// (tests/pipeline/tradeoff/error_budget_test.cpp repeats it).
inline constexpr double kSampledShare = 0.085;
inline constexpr double kCookedShare = 0.05;

}  // namespace sonocase::pipeline::inline exporting
