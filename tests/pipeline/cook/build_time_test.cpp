// SPDX-License-Identifier: Apache-2.0

// How long a build takes is known before it begins.
#include "pipeline/cook/case_cost.h"

#include <gtest/gtest.h>

#include <cmath>
#include <string>

#include "pipeline/segmentation/resample_labels.h"
#include "pipeline/stages/read_recipe.h"

namespace sonocase::pipeline {
namespace {

CaseSize size_of(double label_voxels, double cooked, double labels, double surfaces) {
    CaseSize size;
    size.label_voxels = label_voxels;
    size.cooked_voxels = cooked;
    size.labels = labels;
    size.surfaces = surfaces;
    return size;
}

// Processor seconds of whole commands, two threads: builds that the law was fitted to. The farthest
// is 6.7 % off, the smallest.
TEST(BuildTime, IsWithinATwelfthOfWhatBuildsTook) {
    const struct {
        double cooked, processor_s;
    } demo[] = {{1.47, 7.34}, {4.95, 8.86},  {11.7, 11.6},
                {22.9, 12.9}, {39.6, 16.63}, {93.9, 28.36}},
      real[] = {{2.81, 8.42}, {9.5, 10.8}, {22.5, 14.06}, {44, 18.18}, {76, 24.72}, {180, 43.68}};
    for (const bool analytic : {true, false})
        for (const auto& m : analytic ? demo : real) {
            CaseSize size =
                analytic ? size_of(2.4, m.cooked, 48, 0.69) : size_of(1.4, m.cooked, 68, 0.39);
            if (analytic) size.sampling_s = 0.38 * 2.4;
            const BuildTime time = build_time(size, 64, 1, 2);
            EXPECT_NEAR(time.processor_s / m.processor_s, 1, 1 / 12.0) << m.cooked;
            EXPECT_LT(time.alone_s, time.processor_s);
            EXPECT_GT(time.alone_s, time.processor_s / 2);
        }
}

// Inputs of other kinds that it was not fitted to, each over what the machine's speed was then: a
// neck whose map is known, a slender torso and a CT of cut voxels with twelve refits, a CT on its
// own skin, which has no fit.
TEST(BuildTime, OfOtherKindsIsWithinAFifth) {
    const auto seconds = [](const std::string& recipe, const CaseSize& size) {
        const std::vector<EmbeddedExercise> none;
        const auto read = parse_recipe("name = \"a\"\n" + recipe, "case.toml", {}, &none);
        EXPECT_TRUE(read) << read.error().message();
        return build_time(*read, size, read->settings.of<ResampleOptions>().voxel_mm, 1, 2)
            .processor_s;
    };
    const std::string on = "[warp]\nuncertainty = \"on\"\n";
    CaseSize neck = size_of(2.1, 2.7, 34, 0.27), slender = size_of(4.9, 17, 48, 0.61);
    neck.sampling_s = 0.05 * 2.1;
    slender.sampling_s = 0.38 * 4.9;
    EXPECT_NEAR(seconds("[analytic]\nbody = \"neck\"\nknown_map = true\n", neck) / 3.8, 1, 0.2);
    EXPECT_NEAR(seconds("[analytic]\n" + on, slender) / 13.7, 1, 0.2);
    const std::string ct = "[inputs]\nlabels = \"ct.nii.gz\"\n";
    EXPECT_NEAR(seconds(ct + "surface = \"sweep.csv\"\n" + on, size_of(11, 44.1, 68, 1.58)) / 28.6,
                1, 0.2);
    EXPECT_NEAR(seconds(ct + "own_skin = true\n", size_of(1.4, 11, 68, 0.39)) / 10.4, 1, 0.2);
}

// 88.3 and 209.7 million voxels took 59.4 and 110.3 s where the 1.4 million of real-torso take
// 24.0, with as many cooked voxels.
TEST(BuildTime, OfALargeMapGoesByItsVoxelsAsWell) {
    const double small = build_time(size_of(1.4, 76, 68, 0.39), 64, 1, 2).processor_s,
                 large = build_time(size_of(88.3, 76, 68, 4.19), 64, 1, 2).processor_s,
                 largest = build_time(size_of(209.7, 76, 68, 7.47), 64, 1, 2).processor_s;
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
