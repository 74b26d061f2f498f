// SPDX-License-Identifier: Apache-2.0

// Fourier transforms against the sum that defines them; speckle against its distribution.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <complex>

#include "numerics/property.h"
#include "pipeline/base/periodic_volume.h"
#include "pipeline/texture/fourier.h"
#include "pipeline/texture/speckle_volume.h"
#include "support/hard_case.h"

namespace sonocase::numerics {
namespace {

constexpr long double kLongPi = 3.14159265358979323846264338327950288L;

// Off the defining sum, there and back, over the bound; infinite where power is not kept.
double plane_over_bound(testing::Random random) {
    const int w = 1 << static_cast<int>(random.uniform(0, 4.999)),
              h = 1 << static_cast<int>(random.uniform(0, 4.999));
    std::vector<std::complex<double>> plane(static_cast<std::size_t>(w * h));
    double size = 0;
    for (auto& v : plane) {
        v = {random.gaussian(), random.gaussian()};
        size += std::norm(v);
    }
    std::vector<std::complex<double>> fast = plane;
    pipeline::fourier_plane(fast, w, h, false);
    const double bound = 20 * kEpsilon * std::log2(2.0 * w * h) * std::sqrt(size * w * h);
    double power = 0, worst = 0;
    for (int v = 0; v < h; ++v) {
        for (int u = 0; u < w; ++u) {
            std::complex<long double> sum = 0;
            for (int y = 0; y < h; ++y) {
                for (int x = 0; x < w; ++x) {
                    const long double turn =
                        -2 * kLongPi *
                        (static_cast<long double>(u * x) / w + static_cast<long double>(v * y) / h);
                    sum += std::complex<long double>(plane[y * w + x]) *
                           std::complex<long double>(std::cos(turn), std::sin(turn));
                }
            }
            const auto at = static_cast<std::size_t>(v * w + u);
            worst = std::max(worst, std::abs(fast[at] - std::complex<double>(sum)) / bound);
            power += std::norm(fast[at]);
        }
    }
    if (std::abs(power / (w * h) - size) > 1e-12 * size) return INFINITY;  // Parseval
    pipeline::fourier_plane(fast, w, h, true);
    for (std::size_t i = 0; i < plane.size(); ++i)
        worst = std::max(worst, std::abs(fast[i] - plane[i]) / bound);
    return worst;
}

RC_GTEST_PROP(FourierNumerics, PlaneIsTheDefiningSum, ()) {
    RC_ASSERT(plane_over_bound(random_case()) <= 1);
}

TEST(FourierNumerics, TwoHundredPlanesAreTheDefiningSum) {
    sonocase::testing::HardCase off("transform off the defining sum, over the bound, 200 planes",
                                    sonocase::testing::HardCase::at_most, 1, "");
    for (std::uint64_t seed = 1; seed <= 200; ++seed)
        off.see(plane_over_bound(testing::Random(seed)));
}

// Of values of which many are equal, as a texture's are where it is dark.
TEST(TextureNumerics, EqualValuesAreMatchedToTheWantedDistribution) {
    testing::Random random(3);
    int off = 0;
    for (int draw = 0; draw < 100; ++draw) {
        std::vector<float> values(500), wanted(500);
        for (float& v : values) v = static_cast<float>(std::floor(random.uniform(0, 40)));
        for (float& v : wanted) v = static_cast<float>(random.gaussian());
        std::sort(wanted.begin(), wanted.end());
        pipeline::match_distribution(values, wanted);
        std::sort(values.begin(), values.end());
        for (std::size_t i = 0; i < values.size(); ++i) off += values[i] != wanted[i];
    }
    testing::HardCase matched("of 50,000 values with ties, off the wanted distribution",
                              testing::HardCase::at_most, 0, "");
    matched.see(off);
}

RC_GTEST_PROP(TextureNumerics, MatchedValuesHaveExactlyTheDistributionAndKeepTheirOrder, ()) {
    testing::Random random = random_case();
    std::vector<float> values(500), wanted(500);
    for (float& v : values) v = static_cast<float>(std::floor(random.uniform(0, 40)));  // many ties
    for (float& v : wanted) v = static_cast<float>(random.gaussian());
    std::sort(wanted.begin(), wanted.end());
    const std::vector<float> before = values;
    pipeline::match_distribution(values, wanted);
    std::vector<float> sorted = values;
    std::sort(sorted.begin(), sorted.end());
    RC_ASSERT(sorted == wanted);
    for (std::size_t i = 1; i < values.size(); ++i) {
        if (before[i - 1] < before[i]) RC_ASSERT(values[i - 1] <= values[i]);
    }
}

TEST(SpeckleNumerics, MomentsAreThoseOfTheGaussianWithinChance) {
    sonocase::testing::HardCase off("moments off those of a Gaussian, over five sigmas of chance",
                                    sonocase::testing::HardCase::at_most, 1, "");
    for (std::uint64_t seed : {1ull, 2ull, 77ull}) {
        const SpeckleVolume s = pipeline::make_speckle(32, seed);
        const auto n = static_cast<double>(s.voxels.size() / 2);
        double re = 0, im = 0, rr = 0, ii = 0, ri = 0, fourth = 0, envelope = 0, neighbour = 0;
        for (std::size_t k = 0; k < s.voxels.size(); k += 2) {
            const double a = s.voxels[k] / 32.0, b = s.voxels[k + 1] / 32.0;
            re += a / n, im += b / n, rr += a * a / n, ii += b * b / n, ri += a * b / n;
            fourth += a * a * a * a / n;
            envelope += std::hypot(a, b) / n;
            if (k >= 2) neighbour += a * s.voxels[k - 2] / 32.0 / n;
        }
        const double chance = 5 / std::sqrt(n);  // five sigmas of a mean of unit variance
        for (const double mean : {re, im, ri, neighbour}) off.see(std::abs(mean) / chance);
        for (const double square : {rr, ii})
            off.see(std::abs(square - 1) / (std::sqrt(2.0) * chance));
        // Clipped at 4 sigmas.
        off.see(std::abs(fourth - 3) / (std::sqrt(96.0) * chance + 0.02));
        off.see(std::abs(envelope - std::sqrt(std::acos(-1.0) / 2)) / (0.7 * chance + 0.001));
    }
}

TEST(TextureNumerics, LowpassKeepsTheMeanAndACornerWrapsRound) {
    std::vector<float> v(8 * 8 * 8, 0.0f);
    v[0] = 1;
    pipeline::lowpass_periodic(v, 8, 1);
    double sum = 0;
    for (float x : v) sum += x;
    EXPECT_NEAR(sum, 1, 1e-6);
    EXPECT_FLOAT_EQ(v[0], 6.0f / 16 * 6 / 16 * 6 / 16);
    EXPECT_FLOAT_EQ(v[7], v[1]);  // the other face of the cube
    EXPECT_FLOAT_EQ(v[8 * 7], v[8]);
}

}  // namespace
}  // namespace sonocase::numerics
