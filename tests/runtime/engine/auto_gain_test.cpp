// SPDX-License-Identifier: Apache-2.0

#include "runtime/engine/auto_gain.h"

#include <gtest/gtest.h>

#include <vector>

namespace sonocase::runtime {
namespace {

constexpr int kSide = 240;
const Renderer::Layout kLayout{0.5, 120, 0};

// A picture of a level at each of its eight depths.
std::vector<std::uint8_t> picture(const std::vector<int>& levels) {
    std::vector<std::uint8_t> pixels;
    for (int y = 0; y < kSide; ++y)
        pixels.insert(pixels.end(), kSide,
                      static_cast<std::uint8_t>(levels[static_cast<std::size_t>(8 * y / kSide)]));
    return pixels;
}

constexpr GainLaw kLogarithm{0, 0, 60};

ImageSettings adjusted(const std::vector<int>& levels,
                       ImageSettings settings = {},
                       const GainLaw& law = kLogarithm) {
    adjust_gain(picture(levels), kSide, kLayout, kSide * kLayout.mm_per_px, law, settings);
    return settings;
}

TEST(AutoGain, AMiddlingPictureStays) {
    const ImageSettings after = adjusted({95, 95, 95, 95, 95, 95, 95, 95});
    EXPECT_EQ(after.gain_db, 0);
    for (const double db : after.tgc_db) EXPECT_EQ(db, 0);
}

TEST(AutoGain, ADarkPictureGetsTheDecibelsThatItLacks) {
    ImageSettings settings;
    settings.dynamic_range_db = 51;  // 0.2 dB a level
    const ImageSettings after = adjusted({45, 45, 45, 45, 45, 45, 45, 45}, settings);
    EXPECT_EQ(after.gain_db, 10);
    for (const double db : after.tgc_db) EXPECT_EQ(db, 0);
}

// 6 dB are a factor of two in amplitude, and two thirds of its logarithm in a grey of exponent 2/3;
// a console's range of 90 dB makes that 4/9. The logarithm would say 7 dB, and 11 at 90.
TEST(AutoGain, AMachineOfPowersGetsWhatItsOwnMapAsksFor) {
    const std::vector<int> dark(8, 65);
    EXPECT_EQ(adjusted(dark, {}, {35, 1, 0}).gain_db, 6);
    EXPECT_EQ(adjusted(dark, {}, {35, 2.0 / 3, 60}).gain_db, 9);
    ImageSettings settings;
    settings.dynamic_range_db = 90;
    EXPECT_EQ(adjusted(dark, settings, {35, 2.0 / 3, 60}).gain_db, 14);
    EXPECT_EQ(adjusted(dark, settings, {35, 2.0 / 3, 0}).gain_db, 9);
}

TEST(AutoGain, DepthsAreBroughtTowardsEachOther) {
    const ImageSettings after = adjusted({155, 155, 95, 95, 95, 95, 35, 35});
    EXPECT_LT(after.tgc_db[0], 0);
    EXPECT_EQ(after.tgc_db[3], 0);
    EXPECT_GT(after.tgc_db[7], 0);
}

TEST(AutoGain, WhatShowsNoEchoSaysNothingAndLimitsHold) {
    EXPECT_EQ(adjusted({0, 0, 0, 0, 10, 10, 20, 29}).gain_db, 0);
    ImageSettings settings;
    settings.gain_db = 29;
    EXPECT_EQ(adjusted({31, 31, 31, 31, 31, 31, 31, 31}, settings).gain_db, 30);
    settings.tgc_db.fill(-20);
    EXPECT_EQ(adjusted({255, 31, 31, 31, 31, 31, 31, 31}, settings).tgc_db[0], -20);
    adjust_gain({}, 0, kLayout, 100, kLogarithm, settings);
    adjust_gain({}, 10, kLayout, 0, kLogarithm, settings);
}

}  // namespace
}  // namespace sonocase::runtime
