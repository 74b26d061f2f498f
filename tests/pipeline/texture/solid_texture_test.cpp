// SPDX-License-Identifier: Apache-2.0

// Both methods of making a solid texture.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "pipeline/anatomy/tissue_table.h"
#include "pipeline/base/counter_random.h"
#include "pipeline/base/parallel.h"
#include "pipeline/base/periodic_volume.h"
#include "pipeline/texture/example_image.h"
#include "pipeline/texture/matched_texture.h"
#include "pipeline/texture/pyramid_texture.h"
#include "pipeline/texture/synthetic_examples.h"
#include "pipeline/texture/texture_bank.h"
#include "pipeline/texture/texture_quality.h"

namespace sonocase::pipeline {
namespace {

TEST(PeriodicVolume, MatchingGivesExactlyTheDistributionAndKeepsTheOrder) {
    std::vector<float> values(1000), sorted(1000);
    for (std::size_t i = 0; i < values.size(); ++i) {
        values[i] = static_cast<float>(uniform_at(1, i) - 0.5);
        sorted[i] = static_cast<float>(i * i);
    }
    const std::vector<float> before = values;
    match_distribution(values, sorted);
    for (std::size_t i = 1; i < values.size(); ++i) {
        EXPECT_EQ(values[i] < values[i - 1], before[i] < before[i - 1]);
    }
    std::sort(values.begin(), values.end());
    EXPECT_EQ(values, sorted);
}

TEST(Pyramid, SamplesOfTheJointHistogramFollowTheParent) {
    const ExampleImage example[] = {synthetic_example("liver")};
    const PyramidStatistics s = learn_pyramid(example, {.levels = 3});
    ASSERT_EQ(s.bands.size(), 3u);
    for (std::size_t l = 0; l + 1 < s.bands.size(); ++l) {
        EXPECT_EQ(s.bands[l].children.size(), example[0].count());
        EXPECT_EQ(s.bands[l].row_begin[256], example[0].count());
    }
    // bands sum to the image, so the sum of their means is the image's mean
    double sum = 0, mean = 0;
    for (const PyramidBand& band : s.bands) {
        for (const float v : band.sorted) sum += v;
    }
    for (const float v : example[0].grey) mean += v;
    EXPECT_NEAR(sum / mean, 1, 1e-4);
}

TEST(Pyramid, TooFewPixelsForALevelIsSaid) {
    const ExampleImage example[] = {synthetic_example("liver", 8, 8)};
    const PyramidStatistics s = learn_pyramid(example, {.levels = 4});
    EXPECT_LT(s.bands.size(), 4u);
    ASSERT_FALSE(s.warnings.empty());
    EXPECT_NE(s.warnings[0].find("too few"), std::string::npos) << s.warnings[0];
}

class BothModes : public ::testing::TestWithParam<TextureMode> {};

TEST_P(BothModes, SameBytesForSeedAndAnyNumberOfThreads) {
    const Tissue* liver = find_tissue("liver");
    const Tissue* muscle = find_tissue("muscle");
    const Tissue tissues[] = {*liver, *muscle};
    TextureBankOptions options;
    options.mode = GetParam();
    options.edge = 32;
    std::vector<std::vector<std::uint8_t>> made;
    for (const int threads : {1, 0}) {
        const ThreadLimit limit(threads);
        auto bank = build_texture_bank(tissues, options);
        ASSERT_TRUE(bank);
        ASSERT_EQ(bank->textures.size(), 2u);
        EXPECT_EQ(bank->textures[0].name, "liver");
        EXPECT_EQ(bank->textures[0].voxels.size(), 32u * 32 * 32);
        made.push_back(bank->textures[0].voxels);
    }
    EXPECT_EQ(made[0], made[1]);
    options.seed = 2;
    EXPECT_NE(made[0], build_texture_bank(tissues, options)->textures[0].voxels);
}

TEST_P(BothModes, MeanAndSpreadAreTheCodedOnes) {
    TextureSpec spec;
    spec.name = "liver";
    spec.mode = GetParam();
    spec.edge = 32;
    spec.examples = {synthetic_example("liver")};
    auto made = make_solid_texture(spec);
    ASSERT_TRUE(made);
    double mean = 0, square = 0;
    const auto n = static_cast<double>(made->texture.voxels.size());
    for (const std::uint8_t v : made->texture.voxels) mean += v / n, square += v * v / n;
    // The pyramid draws its coarsest band from 32^3 / 8^3 independent values: 1 / sqrt(64) of 32.
    const double tolerance = GetParam() == TextureMode::pyramid ? 4 : 0.5;
    EXPECT_NEAR(mean, 128, tolerance);
    EXPECT_NEAR(std::sqrt(square - mean * mean), 32, tolerance);
    EXPECT_NEAR(made->grey_mean, 110, 3);
}

INSTANTIATE_TEST_SUITE_P(Modes,
                         BothModes,
                         ::testing::Values(TextureMode::pyramid, TextureMode::matched),
                         [](const auto& mode) {
                             return mode.param == TextureMode::pyramid ? "pyramid" : "matched";
                         });

TEST(MatchedTexture, KeepsGrainAndDirectionOfTheExample) {
    for (const char* name : {"liver", "muscle", "fat"}) {
        TextureSpec spec;
        spec.examples = {synthetic_example(name)};
        auto made = make_solid_texture(spec);
        auto prepared = prepare_example(spec.examples[0]);
        ASSERT_TRUE(made && prepared);
        const TextureQuality q = measure_texture(*made, prepared->image);
        EXPECT_NEAR(q.texture.along / q.example.along, 1, 0.1) << name;
        EXPECT_NEAR(q.texture.across / q.example.across, 1, 0.1) << name;
        EXPECT_NEAR(std::remainder(q.texture.angle_rad - q.example.angle_rad, M_PI), 0, 0.1)
            << name;
        EXPECT_LT(q.distance.ks, 0.03) << name;
        EXPECT_LT(q.seam_score, 2) << name;
    }
}

}  // namespace
}  // namespace sonocase::pipeline
