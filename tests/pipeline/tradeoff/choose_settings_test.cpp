// SPDX-License-Identifier: Apache-2.0

#include "pipeline/tradeoff/choose_settings.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "pipeline/stages/built_in_stages.h"
#include "pipeline/tradeoff/suites.h"

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

// By that law, on a machine of some speed.
std::function<double(const Settings&)> law(double volume_mm3, double speed) {
    return [=](const Settings& settings) {
        return speed * (2 + 1e-6 * volume_mm3 / std::pow(std::stod(settings[0].value), 3));
    };
}

TEST(CostModel, RecoversTheLawThatMadeTheRows) {
    const CostModel model = fit_cost_model(table());
    EXPECT_NEAR(model.fixed_s, 2, 1e-9);
    EXPECT_NEAR(model.per_voxel_s, 1e-6, 1e-15);
}

TEST(ChooseSettings, CheapestWithinTheTolerance) {
    const Choice choice = choose_settings(table(), {.tolerance_mm = 1}, law(8e6, 1));
    EXPECT_EQ(choice.settings, (Settings{{"resample.voxel_mm", "1"}}));
    EXPECT_NEAR(choice.predicted_seconds, 10, 1e-9);
    EXPECT_TRUE(choice.warning.empty());
}

TEST(ChooseSettings, TimeFollowsVolumeAndSpeed) {
    const Choice choice = choose_settings(table(), {.tolerance_mm = 1}, law(16e6, 2));
    EXPECT_NEAR(choice.predicted_seconds, 2 * (2 + 16), 1e-9);
}

TEST(ChooseSettings, BestWithinTheBudget) {
    EXPECT_EQ(choose_settings(table(), {.time_budget_s = 20}, law(8e6, 1)).predicted_error_mm, 0.8);
    EXPECT_EQ(choose_settings(table(), {.time_budget_s = 5}, law(8e6, 1)).predicted_error_mm, 1.5);
}

TEST(ChooseSettings, SaysWhatCannotBeAchieved) {
    EXPECT_NE(choose_settings(table(), {.tolerance_mm = 0.1}, law(8e6, 1)).warning.find("0.4 mm"),
              std::string::npos);
    EXPECT_FALSE(choose_settings(table(), {.time_budget_s = 1}, law(8e6, 1)).warning.empty());
    EXPECT_FALSE(choose_settings(table(), {.tolerance_mm = 0.5, .time_budget_s = 5}, law(8e6, 1))
                     .warning.empty());
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

TEST(NextStep, IsTheCheapestThatIsBetter) {
    const NextStep step = next_step(table(), 2, 8e6);
    EXPECT_EQ(step.settings, "resample.voxel_mm=1");
    EXPECT_EQ(step.error_from_mm, 1.5);
    EXPECT_EQ(step.error_to_mm, 0.8);
    EXPECT_NEAR(step.more_seconds, 7, 1e-9);
    EXPECT_TRUE(next_step(table(), 0.5, 8e6).settings.empty());
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

// A preset that a measured setting beats by a hundredth in both respects is out of date: run
// scripts/accuracy and choose again.
TEST(Presets, LieOnTheMeasuredFront) {
    const FrontTable& front = measured_front();
    for (const Preset& preset : built_in_stages().presets) {
        Settings settings;
        for (const auto& [key, value] : preset.settings) settings.push_back({key, value});
        const auto own = std::find_if(front.rows.begin(), front.rows.end(),
                                      [&](const FrontRow& r) { return r.settings == settings; });
        ASSERT_NE(own, front.rows.end()) << preset.name;
        for (const FrontRow& row : front.rows)
            EXPECT_FALSE(row.error_mm < 0.99 * own->error_mm && row.seconds < 0.99 * own->seconds)
                << preset.name << " is beaten by " << settings_text(row.settings);
    }
}

}  // namespace
}  // namespace sonocase::pipeline
