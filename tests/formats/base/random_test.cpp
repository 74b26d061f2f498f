// SPDX-License-Identifier: Apache-2.0

#include "formats/base/random.h"

#include <gtest/gtest.h>

namespace sonocase {
namespace {

// The first outputs that the authors' reference program prints for seed 0. Bundles, drawn attempts
// and data sets depend on this sequence.
TEST(RandomStream, GivesTheReferenceSequence) {
    RandomStream random(0);
    EXPECT_EQ(random.bits(), 0xE220A8397B1DCDAFull);
    EXPECT_EQ(random.bits(), 0x6E789E6AA1B965F4ull);
    EXPECT_EQ(random.bits(), 0x06C45D188009454Full);
    EXPECT_EQ(mix64(kGoldenGamma), 0xE220A8397B1DCDAFull);
    EXPECT_EQ(mix64(0), 0u);
}

TEST(RandomStream, DerivesNumbersFromTheUpperBitsAndIndicesFromTheRemainder) {
    RandomStream bits(7), units(7), spans(7), indices(7);
    for (int n = 0; n < 100; ++n) {
        const std::uint64_t b = bits.bits();
        const double unit = static_cast<double>(b >> 11) / 9007199254740992.0;
        EXPECT_EQ(units.unit(), unit);
        EXPECT_EQ(spans.uniform(-2, 5), -2 + 7 * unit);
        EXPECT_EQ(indices.below(11), b % 11);
        EXPECT_GE(unit, 0);
        EXPECT_LT(unit, 1);
    }
}

TEST(RandomStream, StaysInTheUnitBallAndOnTheUnitSphere) {
    RandomStream random(1);
    Vector3 sum;
    for (int n = 0; n < 2000; ++n) {
        const Vector3 v = random.in_ball();
        EXPECT_LE(norm(v), 1);
        EXPECT_NEAR(norm(random.direction()), 1, 1e-15);
        sum = sum + v;
    }
    // One coordinate of a point in the ball has the variance 1/5: 2000 of them sum to 0 +- 20.
    EXPECT_LT(norm(sum), 100);
}

}  // namespace
}  // namespace sonocase
