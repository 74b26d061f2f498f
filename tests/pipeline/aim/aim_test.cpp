// SPDX-License-Identifier: Apache-2.0

#include "pipeline/check/aim.h"

#include <gtest/gtest.h>

#include <cmath>

#include "formats/exercise/exercise.h"
#include "pipeline/aim/plain_case.h"

namespace sonocase::pipeline {
namespace {

const AimTarget kLesion{"lesion", {60, 20, 330}, 8};

TEST(Aim, TheFirstWindowIsTheShortWayThroughTheSkin) {
    const CaseBundle bundle = testing::plain_case();
    const CaseLabels labels(bundle);
    const AimResult result = aim(labels, kLesion);
    ASSERT_FALSE(result.windows.empty());
    const AimWindow& first = result.windows[0];
    EXPECT_NEAR(first.depth_mm, 72, 12);  // to the front or the flank
    EXPECT_TRUE(first.needle);
    EXPECT_GT(dot(first.beam, kLesion.centre - first.skin), 0);
    EXPECT_NEAR(std::hypot(first.skin.x / 150, first.skin.y / 100), 1, 0.06);
    for (std::size_t n = 1; n < result.windows.size(); ++n) {
        EXPECT_GE(result.windows[n].cost, result.windows[n - 1].cost);
        EXPECT_GE(distance(result.windows[n].skin, first.skin), 30);
    }
}

TEST(Aim, ARayThroughBoneOrGasIsNoWindow) {
    CaseBundle bundle = testing::plain_case();
    testing::repaint(bundle, [](Point3 p, int label) {  // a plate of bone before the liver
        return label == 2 && p.y > 60 ? 9 : label;
    });
    const CaseLabels labels(bundle);
    for (const AimWindow& window : aim(labels, kLesion).windows) EXPECT_LT(window.skin.y, 75);
    testing::repaint(bundle,
                     [](Point3, int label) { return label == 2 || label == 1 ? 9 : label; });
    const AimResult none = aim(CaseLabels(bundle), kLesion);
    EXPECT_TRUE(none.windows.empty());
    EXPECT_GT(none.blocked_by_bone, 1000);
}

TEST(Aim, ABodyThatIsCutOffHasNoWindowThere) {
    CaseBundle bundle = testing::plain_case();
    const AimTarget high{"high", {60, 20, 460}, 5};
    testing::repaint(bundle, [](Point3 p, int label) { return p.z > 470 ? 0 : label; });
    const AimResult result = aim(CaseLabels(bundle), high);
    EXPECT_GT(result.through_cut, 100);
    for (const AimWindow& window : result.windows) EXPECT_LT(window.skin.z, 470);
}

TEST(Aim, WritesAnExerciseThatReads) {
    const CaseBundle bundle = testing::plain_case();
    const CaseLabels labels(bundle);
    const AimResult result = aim(labels, kLesion);
    const auto exercise = parse_exercise(aim_exercise(kLesion, result, {}), "aim.toml");
    ASSERT_TRUE(exercise) << exercise.error().message();
    ASSERT_EQ(exercise->sweeps.size(), result.windows.size());
    const Sweep& sweep = exercise->sweeps[0];
    EXPECT_EQ(sweep.name, "window-1");
    double nearest = 1e9;
    for (const SweepKey& key : sweep.keys)
        nearest = std::min(nearest, distance(key.needle_tip, kLesion.centre));
    EXPECT_LT(nearest, 0.01);
    // The needle stays in the plane of the image.
    const SweepKey& key = sweep.keys[0];
    EXPECT_NEAR(dot(key.needle_direction, cross(key.beam, key.lateral)), 0, 1e-3);
    // The exercise begins in that plane.
    EXPECT_NEAR(dot(start_pose(*exercise).rotation.column(1), cross(key.beam, key.lateral)), 1,
                1e-3);
    EXPECT_FALSE(aim_picture(labels, kLesion, result).empty());
}

TEST(Aim, FindsTargetsOfExercisesAndLabels) {
    const CaseBundle bundle = testing::plain_case();
    const auto lesion = find_aim_target(bundle, "biopsy/lesion");
    ASSERT_TRUE(lesion);
    EXPECT_EQ(lesion->centre, (Point3{60, 20, 330}));
    const auto spleen = find_aim_target(bundle, "spleen");
    ASSERT_TRUE(spleen);
    EXPECT_LT(distance(spleen->centre, {-85, -20, 340}), 8);
    const auto typo = find_aim_target(bundle, "splen");
    ASSERT_FALSE(typo);
    EXPECT_NE(typo.error().message().find("did you mean 'spleen'"), std::string::npos);
}

}  // namespace
}  // namespace sonocase::pipeline
