// SPDX-License-Identifier: Apache-2.0

#include "pipeline/tradeoff/choose_settings.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "formats/files/atomic_file.h"
#include "pipeline/export/accuracy_picture.h"
#include "pipeline/stages/built_in_stages.h"
#include "pipeline/tradeoff/suites.h"
#include "pipeline/tradeoff/tradeoff_page.h"

namespace sonocase::pipeline {
namespace {

// Seconds of the rows follow 2 + 1e-6 a voxel of a litre of grid.
FrontTable table() {
    FrontTable t;
    t.volume_mm3 = 8e6;
    t.rows = {{{{"resample.voxel_mm", "2"}}, 1.5, 3},
              {{{"resample.voxel_mm", "1"}}, 0.8, 10},
              {{{"resample.voxel_mm", "0.5"}}, 0.4, 66}};
    return t;
}

double voxel_of(const Settings& settings) {
    return std::stod(settings[0].value);
}

// Seconds by that law, on a machine of some speed; a case whose error is 0.8 mm for each mm of
// voxel, and `inside_mm` whatever the voxel.
CaseFigures figures(double volume_mm3, double speed, double inside_mm = 0) {
    return {
        [=](const Settings& settings) { return std::hypot(inside_mm, 0.8 * voxel_of(settings)); },
        [=](const Settings& settings) {
            return speed * (2 + 1e-6 * volume_mm3 / std::pow(voxel_of(settings), 3));
        }};
}

TEST(CostModel, RecoversTheLawThatMadeTheRows) {
    const CostModel model = fit_cost_model(table());
    EXPECT_NEAR(model.fixed_s, 2, 1e-9);
    EXPECT_NEAR(model.per_voxel_s, 1e-6, 1e-15);
}

TEST(ChooseSettings, CheapestWithinTheTolerance) {
    const Choice choice = choose_settings(table(), {.tolerance_mm = 1}, figures(8e6, 1));
    EXPECT_EQ(choice.settings, (Settings{{"resample.voxel_mm", "1"}}));
    EXPECT_NEAR(choice.predicted_seconds, 10, 1e-9);
    EXPECT_NEAR(choice.predicted_error_mm, 0.8, 1e-9);
    EXPECT_TRUE(choice.warning.empty());
}

TEST(ChooseSettings, TimeFollowsVolumeAndSpeed) {
    const Choice choice = choose_settings(table(), {.tolerance_mm = 1}, figures(16e6, 2));
    EXPECT_NEAR(choice.predicted_seconds, 2 * (2 + 16), 1e-9);
}

TEST(ChooseSettings, BestWithinTheBudget) {
    const auto error = [](double budget_s) {
        return choose_settings(table(), {.time_budget_s = budget_s}, figures(8e6, 1))
            .predicted_error_mm;
    };
    EXPECT_NEAR(error(20), 0.8, 1e-9);
    EXPECT_NEAR(error(5), 1.6, 1e-9);
}

// Where the error lies inside the body, seconds of finer voxels buy nothing: none are spent.
TEST(ChooseSettings, TakesTheCheapestOfEqualOnes) {
    const CaseFigures open = figures(8e6, 1, 14);
    for (const AccuracyTarget& target :
         {AccuracyTarget{.tolerance_mm = 3}, AccuracyTarget{.time_budget_s = 1000}}) {
        const Choice choice = choose_settings(table(), target, open);
        EXPECT_EQ(choice.settings, (Settings{{"resample.voxel_mm", "2"}}));
        EXPECT_GT(choice.predicted_error_mm, 14);
    }
}

TEST(ChooseSettings, SaysWhatCannotBeAchieved) {
    const CaseFigures plain = figures(8e6, 1);
    EXPECT_NE(choose_settings(table(), {.tolerance_mm = 0.1}, plain).warning.find("0.4 mm"),
              std::string::npos);
    EXPECT_FALSE(choose_settings(table(), {.time_budget_s = 1}, plain).warning.empty());
    EXPECT_FALSE(
        choose_settings(table(), {.tolerance_mm = 0.5, .time_budget_s = 5}, plain).warning.empty());
}

TEST(MeasuredFront, IsWrittenFromTheKnobsOfTheCaseAlone) {
    Trial knob;
    knob.suite = "case";
    knob.body = "one";
    knob.settings = {{"resample.voxel_mm", "2"}};
    knob.error = 0.5;
    knob.seconds = 4;
    Trial paper = knob;
    paper.role = TrialRole::paper;
    Trial failed = knob;
    failed.settings = {{"resample.voxel_mm", "9"}};
    failed.error = NAN;
    Trial other_body = knob;
    other_body.body = "two";
    other_body.error = 0.6;
    other_body.seconds = 9;
    const std::string text = format_front({knob, paper, failed, other_body}, "one", 8e6, 0.9);
    const std::size_t first = text.find("row(\"resample.voxel_mm=2\", 0.6, 4);");
    ASSERT_NE(first, std::string::npos) << text;
    EXPECT_EQ(text.find("row(", first + 1), std::string::npos);
}

// The reports of a case of 8 litres: open inside, with landmarks if they were given.
std::vector<StageReport> reports(double voxel_mm, double inside_mm, double with_landmarks_mm) {
    StageReport warp, resample;
    warp.stage = "warp";
    warp.measures = {{"skin_median_mm", 0.1}, {"predicted_interior_mm", inside_mm}};
    if (with_landmarks_mm > 0)
        warp.measures.push_back({"interior_with_two_landmarks_mm", with_landmarks_mm});
    resample.stage = "resample";
    resample.measures = {{"voxel_mm", voxel_mm}};
    return {warp, resample};
}

TEST(CasePoints, AreTheCasesOwnErrorAtEveryVoxelAndWithLandmarks) {
    const auto points = case_points(table(), reports(2, 0.1, 0.05), 8e6);
    int present = 0, landmarks = 0;
    double last_s = -HUGE_VAL, last_mm = HUGE_VAL;
    for (const CasePoint& point : points) {
        EXPECT_GE(point.more_seconds, last_s);
        last_s = point.more_seconds;
        present += point.present;
        landmarks += point.landmarks;
        if (point.present) {
            EXPECT_EQ(point.setting, "resample.voxel_mm=2");
            EXPECT_EQ(point.more_seconds, 0);
        }
        if (point.landmarks) continue;
        EXPECT_LT(point.error_mm, last_mm) << point.setting;
        last_mm = point.error_mm;
    }
    EXPECT_EQ(present, 1);
    EXPECT_EQ(landmarks, 1);
    EXPECT_GE(points.size(), 3u);
    // A case that was fitted and not cooked has one point: itself.
    const std::vector<StageReport> fit{reports(2, 0.1, 0)[0]};
    ASSERT_EQ(case_points(table(), fit, 8e6).size(), 1u);
    EXPECT_TRUE(case_points(table(), fit, 8e6)[0].present);
}

TEST(CaseAccuracy, DrawsEveryPartOfTheBudgetAndSaysWhatIsNotKnown) {
    CaseBundle bundle;
    bundle.manifest.case_name = "mine";
    bundle.manifest.stages = reports(2, 14, 5);
    bundle.manifest.stages[0].groups = {{"unknown_p90_mm", {{"liver", 20}, {"aorta", 8}}},
                                        {"unknown_p90_with_two_landmarks_mm", {{"liver", 6}}}};
    const CaseAccuracy accuracy =
        case_accuracy(bundle, case_points(table(), bundle.manifest.stages, 8e6));
    const std::string said = accuracy_text(accuracy);
    for (const char* part : {"mine", "skin beside the mannequin", " 14.00 mm  organs", "together",
                             "tracker", "20.0 mm  (6.0 with two landmarks)", "as it is"})
        EXPECT_NE(said.find(part), std::string::npos) << part << "\n" << said;
    EXPECT_NE(said.find("lies 14 mm from its place in the patient; nearly all of that is organs"),
              std::string::npos)
        << said;
    EXPECT_NE(said.find("Two landmarks far apart would bring that to 5"), std::string::npos)
        << said;
    EXPECT_NE(said.find("Finer voxels buy nothing."), std::string::npos) << said;
    // The longest bar is the largest part's, and no line is wider than its words need.
    EXPECT_NE(said.find("################################  14.00 mm"), std::string::npos) << said;
    const std::string svg = accuracy_svg(accuracy);
    EXPECT_EQ(svg.find("<svg"), svg.find("<"));
    EXPECT_FALSE(write_accuracy_picture(accuracy, "accuracy.gif").has_value());
}

// What an author asks first: the structures that the exercises need.
TEST(CaseAccuracy, PutsStructuresWithTargetsBeforeThoseThatAreKnownLeast) {
    CaseBundle bundle;
    bundle.manifest.stages = reports(2, 14, 5);
    bundle.manifest.stages[0].groups = {
        {"unknown_p90_mm", {{"rib", 30}, {"liver", 20}, {"spleen", 25}, {"aorta", 8}}},
        {"unknown_p90_with_two_landmarks_mm", {{"rib", 3}, {"liver", 6}}}};
    std::string exercise =
        *read_text_file(SONOCASE_SOURCE "/scenarios/demo-torso/liver-biopsy.toml");
    exercise.erase(exercise.find("frame = \"ct\"\n"), 13);  // as a cooked case has it
    bundle.exercises.push_back({.name = "biopsy", .toml = exercise});
    const auto places = unknown_places_of_case(bundle);
    ASSERT_EQ(places.size(), 4u);
    EXPECT_EQ(places[0].label, "liver");
    EXPECT_TRUE(places[0].target);
    EXPECT_EQ(places[1].label, "rib");
    EXPECT_FALSE(places[1].target);
    EXPECT_EQ(landmark_advice(places),
              "two landmarks far apart would bring liver from 20.0 to 6.0 mm");
    // A fit that is good inside asks for finer voxels alone.
    bundle.manifest.stages = reports(2, 0.1, 0);
    const std::string fine =
        accuracy_summary(case_accuracy(bundle, case_points(table(), bundle.manifest.stages, 8e6)));
    EXPECT_NE(fine.find(" With resample.voxel_mm=1 it would be "), std::string::npos) << fine;
}

// The line of each part, and the table of options, are those of the page as it stands.
TEST(AccuracyPage, IsWhatItsOwnPartsSay) {
    const std::string page = *read_text_file(SONOCASE_SOURCE "/docs/accuracy.md");
    EXPECT_EQ(format_accuracy_markdown({}, page), page);
    EXPECT_NE(page.find("| 5.66 in "), std::string::npos);
}

TEST(NextStep, IsTwoLandmarksWhereTheyHelpMost) {
    const NextStep step = next_step(table(), reports(1, 14, 5), 8e6);
    EXPECT_NE(step.step.find("two landmarks"), std::string::npos);
    EXPECT_NEAR(step.error_from_mm, 14, 0.01);
    EXPECT_NEAR(step.error_to_mm, 5, 0.01);
    EXPECT_EQ(step.more_seconds, 0);
}

TEST(NextStep, IsTheLargestVoxelThatLowersTheCasesOwnErrorAndTakesTime) {
    const NextStep step = next_step(table(), reports(2, 0.1, 0), 8e6);
    EXPECT_EQ(step.step, "resample.voxel_mm=1");
    EXPECT_LT(step.error_to_mm, step.error_from_mm);
    EXPECT_NEAR(step.more_seconds, 7, 1e-9);
}

// No voxel helps a case that is open inside, none is finer than the finest, and a step never takes
// less time than none.
TEST(NextStep, IsNoneWhereNothingLowersTheErrorByAHundredth) {
    EXPECT_TRUE(next_step(table(), reports(2, 14, 0), 8e6).step.empty());
    EXPECT_TRUE(next_step(table(), reports(0.5, 0.1, 0), 8e6).step.empty());
    for (const double voxel_mm : {3.0, 2.0, 1.5, 1.0, 0.75, 0.5}) {
        const NextStep step = next_step(measured_front(), reports(voxel_mm, 0.05, 0), 4e7);
        EXPECT_GE(step.more_seconds, 0) << voxel_mm;
        EXPECT_EQ(step.more_seconds > 0, !step.step.empty()) << voxel_mm;
    }
}

TEST(MeasuredFront, HasRowsWhoseSettingsAreKnownToTheRecipe) {
    ASSERT_FALSE(measured_front().rows.empty());
    for (const FrontRow& row : measured_front().rows) {
        EXPECT_GT(row.error_mm, 0);
        EXPECT_GT(row.seconds, 0);
        StageSettings options(built_in_stages());
        EXPECT_TRUE(apply_settings(row.settings, options).has_value())
            << settings_text(row.settings);
    }
}

// Without what only says more of the error and leaves every surface where it is.
Settings of_surfaces(const Settings& settings) {
    Settings rest;
    for (const Setting& s : settings)
        if (s.key != "warp.uncertainty") rest.push_back(s);
    return rest;
}

// A preset that a measured setting beats by a hundredth in both respects is out of date: run
// scripts/accuracy and choose again.
TEST(Presets, LieOnTheMeasuredFront) {
    const FrontTable& front = measured_front();
    for (const Preset& preset : built_in_stages().presets) {
        Settings settings;
        for (const auto& [key, value] : preset.settings) settings.push_back({key, value});
        const auto own = std::find_if(front.rows.begin(), front.rows.end(), [&](const FrontRow& r) {
            return of_surfaces(r.settings) == of_surfaces(settings);
        });
        ASSERT_NE(own, front.rows.end()) << preset.name;
        for (const FrontRow& row : front.rows)
            EXPECT_FALSE(row.error_mm < 0.99 * own->error_mm && row.seconds < 0.99 * own->seconds)
                << preset.name << " is beaten by " << settings_text(row.settings);
    }
}

}  // namespace
}  // namespace sonocase::pipeline
