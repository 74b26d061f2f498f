// SPDX-License-Identifier: Apache-2.0

#include "formats/base/portable_math.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "formats/base/constants.h"

namespace sonocase {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

// A library's own atan2 is within one unit in the last place, ours within two.
constexpr double kFewUlp = 3 * std::numeric_limits<double>::epsilon();

TEST(ArcTangent, AgreesWithTheLibraryAllRound) {
    for (int i = -180000; i <= 180000; ++i) {
        const double angle = i * 1e-5 * kPi / 1.8;
        for (const double length : {1e-150, 1.0, 3e7}) {
            const double y = length * std::sin(angle), x = length * std::cos(angle);
            ASSERT_NEAR(arc_tangent(y, x), std::atan2(y, x), kFewUlp * std::fabs(angle) + 1e-300)
                << angle;
        }
    }
}

TEST(ArcTangent, KeepsSmallAngles) {
    for (double t = 1e-300; t < 0.1; t *= 1.7)
        EXPECT_NEAR(arc_tangent(t, 1) / t, std::atan2(t, 1.0) / t, kFewUlp);
}

TEST(ArcTangent, SpecialValues) {
    const double values[] = {0.0, -0.0, 1.0, -1.0, kInfinity, -kInfinity, 1e-310, -1e300};
    for (const double y : values) {
        for (const double x : values) {
            EXPECT_NEAR(arc_tangent(y, x), std::atan2(y, x), 1e-15) << y << " " << x;
            EXPECT_EQ(std::signbit(arc_tangent(y, x)), std::signbit(std::atan2(y, x)));
        }
    }
    EXPECT_TRUE(std::isnan(arc_tangent(std::nan(""), 1)));
    EXPECT_TRUE(std::isnan(arc_tangent(1, std::nan(""))));
}

// The bits themselves: a platform on which these differ would score differently.
TEST(ArcTangent, BitsAreThoseOfEveryPlatform) {
    EXPECT_EQ(arc_tangent(1, 3), 0x1.4978fa3269ee1p-2);
    EXPECT_EQ(arc_tangent(2, -1), 0x1.0468a8ace4df6p+1);
}

}  // namespace
}  // namespace sonocase
