// SPDX-License-Identifier: Apache-2.0

// How long a build takes is known before it begins.
#include "pipeline/cook/case_cost.h"

#include <gtest/gtest.h>

#include <cmath>
#include <string>

#include "pipeline/stages/read_recipe.h"

namespace sonocase::pipeline {
namespace {

// Processor seconds of whole commands, two threads: the builds that the law was fitted to.
TEST(BuildTime, IsWithinATenthOfWhatBuildsTook) {
    const struct {
        double cooked, labels, processor_s;
    } measured[] = {{1.47, 3.3, 7.34},  {4.95, 3.3, 8.86},  {11.7, 3.3, 11.6}, {22.9, 3.3, 12.9},
                    {39.6, 3.3, 16.63}, {93.9, 3.3, 28.36}, {2.81, 1.4, 8.42}, {9.5, 1.4, 10.8},
                    {22.5, 1.4, 14.06}, {44, 1.4, 18.18},   {76, 1.4, 24.72},  {180, 1.4, 43.68}};
    for (const auto& m : measured) {
        const BuildTime time = build_time({m.labels, m.labels, m.cooked}, 64, 1, 2);
        EXPECT_NEAR(time.processor_s / m.processor_s, 1, 0.1) << m.cooked;
        EXPECT_LT(time.alone_s, time.processor_s);
        EXPECT_GT(time.alone_s, time.processor_s / 2);
    }
}

// 88.3 and 209.7 million voxels took 59.4 and 110.3 s where the 1.4 million of real-torso take
// 24.0, with as many cooked voxels.
TEST(BuildTime, OfALargeMapGoesByItsVoxelsAsWell) {
    const double small = build_time({1.4, 1.4, 76}, 64, 1, 2).processor_s;
    const double large = build_time({88.3, 88.3, 76}, 64, 1, 2).processor_s,
                 largest = build_time({209.7, 209.7, 76}, 64, 1, 2).processor_s;
    EXPECT_NEAR(large - small, 59.4 - 24, 4);
    EXPECT_NEAR(largest - small, 110.3 - 24, 4);
}

// Regions of real-torso round liver, spleen and gallbladder added 18.7, 9.1 and 3.5 s; by so much
// do two runs on a busy machine differ.
TEST(BuildTime, VoxelsOfARegionCostAsMuchAsOthersWithoutTheirSurfaces) {
    const struct {
        double million, processor_s;
    } measured[] = {{178.6, 18.7}, {74.2, 9.1}, {33.5, 3.5}};
    CaseSize size{1.4, 1.4, 76};
    const double without = build_time(size, 64, 1, 2).processor_s;
    for (const auto& m : measured) {
        size.region_voxels = m.million;
        EXPECT_NEAR(build_time(size, 64, 1, 2).processor_s - without, m.processor_s, 2);
    }
}

// Processor seconds of the stage pathology in the demo torso: 1, 4 and 16 lesions of
// scenarios/lesion-gallery, of which three are free fluid.
TEST(BuildTime, CountsLesionsAndFreeFluid) {
    const struct {
        double cooked, lesions, pools, stage_s;
    } measured[] = {{11.7, 1, 0, 0.19},
                    {39.6, 1, 0, 0.47},
                    {39.6, 4, 0, 1.32},
                    {11.7, 13, 3, 6.69},
                    {39.6, 13, 3, 21.3}};
    for (const auto& m : measured) {
        CaseSize size{2.4, 2.4, m.cooked};
        const double without = build_time(size, 64, 1, 2).processor_s;
        size.lesions = m.lesions;
        size.pools = m.pools;
        const double more = build_time(size, 64, 1, 2).processor_s - without;
        EXPECT_NEAR(more, m.stage_s, 0.1 * m.stage_s + 0.4) << m.cooked << " " << m.lesions;
    }
}

TEST(BuildTime, FollowsSpeedThreadsAndTextures) {
    const CaseSize size{1, 1, 40};
    const BuildTime one = build_time(size, 64, 1, 1), slow = build_time(size, 64, 2, 1);
    EXPECT_NEAR(slow.processor_s, 2 * one.processor_s, 1e-9);
    EXPECT_NEAR(slow.alone_s, 2 * one.alone_s, 1e-9);
    EXPECT_NEAR(one.alone_s, one.processor_s, 1e-9);
    EXPECT_LE(build_time(size, 64, 1, 2).alone_s, one.alone_s);
    EXPECT_LT(build_time(size, 32, 1, 1).processor_s, one.processor_s);
}

TEST(BuildTime, OfARecipeTakesItsVoxel) {
    const std::vector<EmbeddedExercise> none;
    const auto recipe = parse_recipe(
        "name = \"a\"\n[analytic]\n[resample]\nvoxel_mm = 2\n"
        "[warp]\nuncertainty = \"off\"\n",
        "case.toml", {}, &none);
    ASSERT_TRUE(recipe) << recipe.error().message();
    const BuildTime time = build_time(*recipe, {1, 1, 40}, 1, 1, 2);
    EXPECT_NEAR(time.processor_s, build_time({1, 1, 5}, 64, 1, 2).processor_s, 1e-9);
    // Refits are part of the preset that holds where none is named; a known map has no fit at all.
    const auto with = [&](const char* more) {
        const auto other = parse_recipe(
            "name = \"a\"\n[analytic]\n" + std::string(more) + "[resample]\nvoxel_mm = 2\n",
            "case.toml", {}, &none);
        EXPECT_TRUE(other);
        return build_time(*other, {1, 1, 40}, 1, 1, 2).processor_s;
    };
    EXPECT_GT(with(""), time.processor_s);
    EXPECT_LT(with("known_map = true\n"), time.processor_s);
}

// The machine of a test is fast or slow, and its measure a number.
TEST(BuildTime, SpeedOfThisMachineIsMeasured) {
    const double speed = machine_speed();
    EXPECT_TRUE(std::isfinite(speed));
    EXPECT_GT(speed, 0.01);
    EXPECT_LT(speed, 1000);
}

}  // namespace
}  // namespace sonocase::pipeline
