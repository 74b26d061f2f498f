// SPDX-License-Identifier: Apache-2.0

#include "formats/base/portable_math.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

namespace sonocase {
namespace {

// A library's own functions are within one unit in the last place, ours within two.
constexpr double kFewUlp = 3 * std::numeric_limits<double>::epsilon();

TEST(PortableMath, SineAndCosineAgreeWithTheLibrary) {
    for (int i = -400000; i <= 400000; ++i) {
        const double x = 1e-4 * i + 1e-9 * (i % 97);
        ASSERT_NEAR(sine(x), std::sin(x), kFewUlp * std::fabs(std::sin(x)) + 1e-16) << x;
        ASSERT_NEAR(cosine(x), std::cos(x), kFewUlp * std::fabs(std::cos(x)) + 1e-16) << x;
    }
    // Eight hours of a heart at 200 beats per minute are 6e5 radians.
    for (double x = 50; x < 1e6; x *= 1.0007) {
        ASSERT_NEAR(sine(x), std::sin(x), kFewUlp) << x;
        ASSERT_NEAR(cosine(-x), std::cos(x), kFewUlp) << x;
    }
}

TEST(PortableMath, SmallAnglesAndZeros) {
    for (double x = 1e-300; x < 0.1; x *= 1.7) EXPECT_NEAR(sine(x) / x, std::sin(x) / x, kFewUlp);
    EXPECT_EQ(sine(0), 0);
    EXPECT_EQ(cosine(0), 1);
    EXPECT_EQ(sine(-0.3), -sine(0.3));
    EXPECT_TRUE(std::isnan(sine(std::numeric_limits<double>::infinity())));
    EXPECT_TRUE(std::isnan(cosine(std::nan(""))));
}

TEST(PortableMath, ExponentialAgreesWithTheLibrary) {
    for (double x = -745; x < 709.7; x += 0.0137)
        ASSERT_NEAR(exponential(x), std::exp(x), kFewUlp * std::exp(x) + 1e-323) << x;
    EXPECT_EQ(exponential(0), 1);
    EXPECT_EQ(exponential(-800), 0);
    EXPECT_TRUE(std::isinf(exponential(710)));
    EXPECT_TRUE(std::isnan(exponential(std::nan(""))));
}

// The bits themselves: a platform on which these differ would score differently.
TEST(PortableMath, BitsAreThoseOfEveryPlatform) {
    EXPECT_EQ(sine(1), 0x1.aed548f090ceep-1);
    EXPECT_EQ(cosine(2), -0x1.aa22657537205p-2);
    EXPECT_EQ(sine(1e5), 0x1.24daa9c527e96p-5);
    EXPECT_EQ(exponential(-0.5), 0x1.368b2fc6f960ap-1);
}

TEST(PortableMath, HypotenuseOfATriangle) {
    EXPECT_EQ(hypotenuse(3, -4), 5);
    EXPECT_EQ(hypotenuse(0, 0), 0);
}

}  // namespace
}  // namespace sonocase
