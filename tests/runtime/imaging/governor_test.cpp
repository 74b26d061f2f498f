// SPDX-License-Identifier: Apache-2.0

#include "runtime/imaging/core/governor.h"

#include <gtest/gtest.h>

#include "imaging_support.h"

namespace sonocase::runtime {
namespace {

double took(int level, double full_ms) {
    return full_ms * kAccuracyLevels[static_cast<std::size_t>(level)].work;
}

TEST(Governor, SettlesOnTheFinestLevelThatFits) {
    // Work of the levels is 1, 0.77, 0.54 and 0.32 of the full frame.
    const double budget = 10;
    for (const auto& [full_ms, expected] :
         {std::pair{5.0, 0}, {12.5, 1}, {16.5, 2}, {28.0, 3}, {100.0, 3}}) {
        Governor governor(budget);
        for (int i = 0; i < 400; ++i) governor.frame_took(took(governor.level(), full_ms));
        EXPECT_EQ(governor.level(), expected) << full_ms;
    }
}

// Each level gives up some beams and some samples, and saves less than their share: part of a
// frame's work is the same at all levels.
TEST(Governor, LevelsFallInEveryRespect) {
    for (std::size_t i = 1; i < kAccuracyLevels.size(); ++i) {
        const AccuracyLevel &finer = kAccuracyLevels[i - 1], &coarser = kAccuracyLevels[i];
        EXPECT_LT(coarser.lines, finer.lines);
        EXPECT_LT(coarser.samples, finer.samples);
        EXPECT_LE(coarser.looks, finer.looks);
        EXPECT_LT(coarser.work, finer.work);
        EXPECT_GE(coarser.work, coarser.lines * coarser.samples);
    }
}

TEST(Governor, ComesBackWhenTheSceneIsEasyAndIgnoresOneLateFrame) {
    Governor governor(10);
    for (int i = 0; i < 200; ++i) governor.frame_took(took(governor.level(), 30));
    EXPECT_EQ(governor.level(), 3);
    for (int i = 0; i < 300; ++i) governor.frame_took(took(governor.level(), 5));
    EXPECT_EQ(governor.level(), 0);
    governor.frame_took(40);
    EXPECT_EQ(governor.level(), 0);
}

// A clock by which everything is slow: it advances by a second per call.
double every_frame_takes_long() {
    static double now_s = 0;
    return now_s += 1;
}

TEST(Governor, OffByDefaultAndTheFirstLevelIsTheFullPicture) {
    Governor off;
    for (int i = 0; i < 100; ++i) off.frame_took(1e6);
    EXPECT_EQ(off.level(), 0);
    RenderOptions options;
    options.width_px = options.height_px = 128;
    options.host.clock = every_frame_takes_long;
    const auto plain = draw(phantom_exercise(), options, needle_input());
    options.frame_budget_ms = 1e6;
    EXPECT_TRUE(draw(phantom_exercise(), options, needle_input()) == plain);
    options.frame_budget_ms = 1;  // cannot be met: ends at the coarsest, and says so
    auto renderer = Renderer::create(phantom(), phantom_exercise(), options);
    ASSERT_TRUE(renderer.has_value());
    std::vector<std::uint8_t> pixels(128 * 128);
    for (int i = 0; i < 60; ++i) renderer->render(needle_input(), pixels);
    EXPECT_EQ(renderer->accuracy().level, 3);
    EXPECT_EQ(renderer->accuracy().scanlines, renderer->accuracy().full_scanlines / 2);
    EXPECT_LT(compare(pixels, plain).mean, 25);  // the same scene
}

TEST(Governor, DoesNothingWithoutAClock) {
    RenderOptions options;
    options.width_px = options.height_px = 64;
    options.frame_budget_ms = 1e-6;
    auto renderer = Renderer::create(phantom(), phantom_exercise(), options);
    ASSERT_TRUE(renderer.has_value());
    std::vector<std::uint8_t> pixels(64 * 64);
    for (int i = 0; i < 30; ++i) renderer->render(needle_input(), pixels);
    EXPECT_EQ(renderer->accuracy().level, 0);
    EXPECT_EQ(renderer->accuracy().levels, 1);
    for (const EffectCost& cost : renderer->costs()) EXPECT_EQ(cost.ms, 0) << cost.name;
}

}  // namespace
}  // namespace sonocase::runtime
