// SPDX-License-Identifier: Apache-2.0

#include "pipeline/check/scripted_expert.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "pipeline/aim/plain_case.h"

namespace sonocase::pipeline {
namespace {

constexpr const char* kMarks = R"(
[breathing]
amplitude_mm = 8
period_s = 4
direction = [0, 0, -1]
[[pass_marks]]
metric = "final_tip_to_target_mm"
at_most = 1
[[pass_marks]]
metric = "tip_in_view_at_advance_fraction"
at_least = 0.7
[[pass_marks]]
metric = "needle_in_beam_fraction"
at_least = 0.6
[[pass_marks]]
metric = "no_go_contacts"
at_most = 0
[[pass_marks]]
metric = "insertions"
at_most = 1
)";

// The plain case's exercise with a probe and more lines of TOML.
Exercise exercise_with(const std::string& lines) {
    const std::string toml = std::string("") + testing::kPlainExercise + lines;
    const auto exercise = parse_exercise(toml, "test.toml");
    EXPECT_TRUE(exercise) << exercise.error().message();
    return *exercise;
}

ExpertAttempt play(const CaseBundle& bundle, const Exercise& exercise) {
    const CaseLabels labels(bundle);
    std::vector<AimWindow> windows;
    for (const Target& target : exercise.targets) {
        const AimResult found =
            aim(labels, {target.name, target.centre, target.radius_mm}, aim_options(exercise));
        EXPECT_FALSE(found.windows.empty());
        windows.push_back(found.windows[0]);
    }
    return play_as_expert(bundle, exercise, windows);
}

TEST(ScriptedExpert, PassesThroughTheFirstWindowWhileTheOrgansBreathe) {
    const CaseBundle bundle = testing::plain_case();
    const Exercise exercise = exercise_with(kMarks);
    const ExpertAttempt attempt = play(bundle, exercise);
    for (const std::string& mark : attempt.missed) ADD_FAILURE() << mark;
    EXPECT_EQ(attempt.score.insertions.size(), 1u);
    // It waits for the end of a breath, where the target lies as written.
    EXPECT_LT(attempt.score.value("final_tip_to_target_mm"), 0.1);
    EXPECT_GT(attempt.session.samples.size(), 100u);
}

TEST(ScriptedExpert, TellsTheMarkThatCannotBeEarned) {
    const CaseBundle bundle = testing::plain_case();
    const ExpertAttempt attempt = play(bundle, exercise_with(R"(
[[pass_marks]]
metric = "time_in_tissue_s"
at_most = 1
[[pass_marks]]
metric = "probe_force_max_n"
at_most = 5
)"));
    ASSERT_EQ(attempt.missed.size(), 1u);  // force is not judged
    EXPECT_TRUE(attempt.missed[0].starts_with("time_in_tissue_s = ")) << attempt.missed[0];
    EXPECT_NE(attempt.missed[0].find("at most 1"), std::string::npos);
}

TEST(ScriptedExpert, TakesOneTargetAfterTheOther) {
    const CaseBundle bundle = testing::plain_case();
    const ExpertAttempt attempt = play(bundle, exercise_with(R"(
[[targets]]
name = "second"
centre = [-85, -20, 340]
radius_mm = 5
[[pass_marks]]
metric = "targets_hit_fraction"
at_least = 1
)"));
    for (const std::string& mark : attempt.missed) ADD_FAILURE() << mark;
    EXPECT_EQ(attempt.score.insertions.size(), 2u);
}

TEST(ScriptedExpert, ALinearProbeSeesNoFartherThanItsPicture) {
    const CaseBundle bundle = testing::plain_case();
    Exercise exercise = exercise_with("");
    exercise.probe.shape = ProbeShape::linear;
    exercise.probe.width_mm = 40;
    exercise.probe.depth_mm = 50;  // the target lies 80 mm deep
    const CaseLabels labels(bundle);
    const AimTarget deep{"lesion", {60, 20, 330}, 8}, shallow{"fat", {60, 70, 330}, 4};
    const AimOptions options = aim_options(exercise);
    EXPECT_TRUE(aim(labels, deep, options).windows.empty());
    const AimResult found = aim(labels, shallow, options);
    ASSERT_FALSE(found.windows.empty());
    EXPECT_TRUE(found.windows[0].needle);
    EXPECT_GT(found.windows[0].visible, 0.5);
}

}  // namespace
}  // namespace sonocase::pipeline
