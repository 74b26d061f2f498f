// SPDX-License-Identifier: Apache-2.0

#include "pipeline/segmentation/level_set_smoothing.h"
#include "formats/base/constants.h"

#include <gtest/gtest.h>

#include <cmath>

#include "pipeline/base/parallel.h"
#include "support/shapes.h"

namespace sonocase::pipeline {
namespace {

using namespace sonocase::testing;  // shapes and maps of known answer

LabelVolume sphere(double radius, int edge = 32) {
    return sample_labels(cubic_grid(edge), 2,
                         [&](Point3 p) { return norm_of(p) <= radius ? 1 : 0; });
}

LabelVolume tube(double radius) {
    return sample_labels(cubic_grid(32), 2,
                         [&](Point3 p) { return std::hypot(p.x, p.y) <= radius ? 1 : 0; });
}

// At rest K0 (R - r) = 2 / r on a sphere and K0 (R - r) = 1 / r on a tube.
TEST(LevelSetSmoothing, SphereShrinksToItsEquilibrium) {
    LevelSetOptions options;
    options.k0 = 0.5;
    options.iterations = 120;
    const double big = 10;
    const double expected = 0.5 * (big + std::sqrt(big * big - 8 / options.k0));
    const auto result = level_set_smoothing(sphere(big), options);
    ASSERT_TRUE(result);
    const double volume = static_cast<double>(count_label(result->volume, 1));
    const double radius = std::cbrt(volume * 3 / (4 * kPi));
    // A quarter of a voxel: phi_0 is known to half a voxel only.
    EXPECT_NEAR(radius, expected, 0.25);
}

// In voxels of 2 mm: curvature is in 1/mm whatever the voxel.
TEST(LevelSetSmoothing, EquilibriumDoesNotDependOnTheVoxel) {
    LevelSetOptions options;
    options.k0 = 0.5;
    options.iterations = 120;
    const LabelVolume ball =
        sample_labels(cubic_grid(20, 2), 2, [](Point3 p) { return norm_of(p) <= 10 ? 1 : 0; });
    const auto result = level_set_smoothing(ball, options);
    ASSERT_TRUE(result);
    const auto radius = [](const LabelVolume& volume) {
        return std::cbrt(8 * static_cast<double>(count_label(volume, 1)) * 3 / (4 * kPi));
    };
    // An eighth of a voxel. With curvatures twice as strong it would be 0.9 instead of 0.42.
    const double shrinkage = 10 - 0.5 * (10 + std::sqrt(100 - 8 / options.k0));
    EXPECT_NEAR(radius(ball) - radius(result->volume), shrinkage, 0.25);
}

TEST(LevelSetSmoothing, TubeBelowTheCriticalRadiusDiesAndIsNamed) {
    LevelSetOptions options;
    options.k0 = 0.3;  // 2 / sqrt(K0) = 3.65 mm
    options.iterations = 200;
    const auto thin = level_set_smoothing(tube(2), options);
    ASSERT_TRUE(thin);
    EXPECT_EQ(count_label(thin->volume, 1), 0u);
    ASSERT_EQ(thin->changes.size(), 1u);
    EXPECT_TRUE(thin->changes[0].lost());
    ASSERT_EQ(thin->report.warnings.size(), 1u);
    EXPECT_NE(thin->report.warnings[0].find("label_1"), std::string::npos);
    const auto thick = level_set_smoothing(tube(6), options);
    ASSERT_TRUE(thick);
    EXPECT_GT(count_label(thick->volume, 1), 0.5 * static_cast<double>(count_label(tube(6), 1)));
}

TEST(LevelSetSmoothing, StepAboveTheLimitIsRefused) {
    LevelSetOptions options;
    options.time_step = 1.01 * max_stable_step(options.k0, 1);
    const auto result = level_set_smoothing(sphere(5, 16), options);
    ASSERT_FALSE(result);
    EXPECT_NE(result.error().message().find("limit of stability"), std::string::npos);
}

TEST(LevelSetSmoothing, ThickSlicesAreRefused) {
    LabelVolume volume = sphere(5, 16);
    volume.grid.spacing_mm.z = 5;
    EXPECT_FALSE(level_set_smoothing(volume));
}

TEST(LevelSetSmoothing, LeavesNoGapBetweenLabels) {
    // Three labels meet; thresholding each layer at 0 would leave voxels that none of them claims.
    const LabelVolume volume = sample_labels(cubic_grid(24), 4, [](Point3 p) {
        return p.x < 0 ? 1 : p.y < 0 ? 2 : 3;
    });
    const auto result = level_set_smoothing(volume);
    ASSERT_TRUE(result);
    EXPECT_EQ(count_label(result->volume, 0), 0u);
}

TEST(LevelSetSmoothing, SameBytesForOneAndTwoThreads) {
    const LabelVolume volume = sphere(9);
    LevelSetOptions options;
    options.iterations = 10;
    std::vector<std::uint8_t> bytes[2];
    for (const int threads : {1, 2}) {
        const ThreadLimit limit(threads);
        const auto result = level_set_smoothing(volume, options);
        ASSERT_TRUE(result);
        bytes[threads - 1] = result->volume.voxels;
    }
    EXPECT_EQ(bytes[0], bytes[1]);
}

}  // namespace
}  // namespace sonocase::pipeline
