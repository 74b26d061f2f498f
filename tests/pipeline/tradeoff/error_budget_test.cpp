// SPDX-License-Identifier: Apache-2.0

#include "pipeline/export/error_budget.h"

#include <gtest/gtest.h>

#include <cmath>

#include "pipeline/segmentation/resample_labels.h"
#include "pipeline/tradeoff/boundary_error.h"

namespace sonocase::pipeline {
namespace {

StageReport report(const char* stage, std::vector<Measure> measures) {
    StageReport r;
    r.stage = stage;
    r.measures = std::move(measures);
    return r;
}

TEST(ErrorBudget, AddsWhatIsKnownAndNamesWhatIsNot) {
    const std::vector<StageReport> stages{report("import", {{"voxel_volume_mm3", 8}}),
                                          report("warp", {{"skin_median_mm", 0.3}}),
                                          report("resample", {{"voxel_mm", 1}})};
    const ErrorBudget budget = error_budget(stages);
    ASSERT_EQ(budget.entries.size(), 4u);
    EXPECT_DOUBLE_EQ(budget.entries[0].mm, 2 * kSampledShare);
    EXPECT_DOUBLE_EQ(budget.entries[1].mm, 0.3);
    EXPECT_TRUE(std::isnan(budget.entries[2].mm));
    EXPECT_DOUBLE_EQ(budget.entries[3].mm, kCookedShare);
    EXPECT_NEAR(budget.known_mm, std::sqrt(4 * kSampledShare * kSampledShare + 0.09 + 0.0025),
                1e-12);
}

TEST(ErrorBudget, HasWhatTheReadingsOfTheCaseLeaveOpenInside) {
    const ErrorBudget budget = error_budget(
        std::vector{report("warp", {{"skin_median_mm", 0.3}, {"predicted_interior_mm", 4}})});
    ASSERT_EQ(budget.entries.size(), 2u);
    EXPECT_DOUBLE_EQ(budget.entries[1].mm, 4);
    EXPECT_NEAR(budget.known_mm, std::hypot(0.3, 4), 1e-12);
}

TEST(ErrorBudget, LeavesOutWhatWasNotReported) {
    EXPECT_TRUE(error_budget({}).entries.empty());
    EXPECT_TRUE(
        error_budget(std::vector{report("import", {{"voxel_volume_mm3", NAN}})}).entries.empty());
    // A known map has no fit to speak of.
    EXPECT_TRUE(error_budget(std::vector{report("warp", {})}).entries.empty());
}

// Worst first, with what two landmarks would bring where the fit says it.
TEST(UnknownPlaces, AreThoseOfTheFitWithTheAdviceThatHelpsMost) {
    StageReport fit = report("warp", {});
    fit.groups = {
        {"unknown_p90_mm", {{"spleen", 4}, {"liver", 11}, {"bladder", 12}}},
        {"unknown_p90_with_two_landmarks_mm", {{"spleen", 3.9}, {"liver", 3}, {"bladder", 11}}}};
    const std::vector<UnknownPlace> places = unknown_places(std::vector{fit});
    ASSERT_EQ(places.size(), 3u);
    EXPECT_EQ(places[0].label, "bladder");
    EXPECT_EQ(places[2].label, "spleen");
    EXPECT_EQ(landmark_advice(places),
              "two landmarks far apart would bring liver from 11.0 to 3.0 mm");
    // Gains of less than a tenth are not worth a person's hand; without figures none are promised.
    fit.groups[1].values = {{"spleen", 3.9}};
    EXPECT_EQ(landmark_advice(unknown_places(std::vector{fit})), "");
    fit.groups.pop_back();
    EXPECT_EQ(landmark_advice(unknown_places(std::vector{fit})), "");
    EXPECT_TRUE(unknown_places({}).empty());
}

// The shares are measurements. Bodies sampled finely and coarsely, in thick slices and in cubes,
// cooked finely and coarsely: the budget is within a factor of 1.5 of the error that the truth
// shows, which is what a reader needs to see which stage to spend time on.
TEST(ErrorBudget, IsWhatTheAnalyticTorsoShows) {
    struct Setting {
        Vector3 spacing_mm;
        double voxel_mm;
    };
    const Registration truth = analytic_torso_truth();
    for (const Setting s :
         {Setting{{2, 2, 3}, 1.5}, {{1.5, 1.5, 5}, 1.5}, {{3, 3, 3}, 3}, {{2, 2, 2}, 4}}) {
        const LabelVolume ct = sample_analytic_torso(analytic_torso_grid(s.spacing_mm));
        ResampleOptions options;
        options.voxel_mm = s.voxel_mm;
        const auto made = resample_labels({ct, truth}, options);
        ASSERT_TRUE(made);
        const double error =
            measure_boundary_error(made->volume, made->boundary, truth, {}, 100000).displaced_mm;
        const ErrorBudget budget = error_budget(std::vector{
            report("import", {{"voxel_volume_mm3", ct.grid.voxel_volume_mm3()}}), made->report});
        EXPECT_GT(error, budget.known_mm / 1.5) << s.spacing_mm.z << " " << s.voxel_mm;
        EXPECT_LT(error, budget.known_mm * 1.5) << s.spacing_mm.z << " " << s.voxel_mm;
    }
}

}  // namespace
}  // namespace sonocase::pipeline
