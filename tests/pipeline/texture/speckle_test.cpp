// SPDX-License-Identifier: Apache-2.0

#include "pipeline/texture/speckle_volume.h"

#include <gtest/gtest.h>

#include <cmath>

#include "pipeline/base/parallel.h"

namespace sonocase::pipeline {
namespace {

TEST(Speckle, EnvelopeIsRayleigh) {
    const SpeckleVolume s = make_speckle(64, 7);
    ASSERT_EQ(s.voxels.size(), 2u * 64 * 64 * 64);
    const auto count = static_cast<double>(s.voxels.size() / 2);
    double mean_a = 0, mean_b = 0, aa = 0, bb = 0, ab = 0, e1 = 0, e2 = 0;
    for (std::size_t i = 0; i < s.voxels.size(); i += 2) {
        const double a = s.voxels[i] / 32.0, b = s.voxels[i + 1] / 32.0;
        mean_a += a / count, mean_b += b / count;
        aa += a * a / count, bb += b * b / count, ab += a * b / count;
        e1 += std::hypot(a, b) / count, e2 += (a * a + b * b) / count;
    }
    // standard error of a mean over 262144 values is 0.002, of a variance 0.0028
    EXPECT_NEAR(mean_a, 0, 0.01);
    EXPECT_NEAR(mean_b, 0, 0.01);
    EXPECT_NEAR(aa, 1, 0.014);
    EXPECT_NEAR(bb, 1, 0.014);
    EXPECT_NEAR(ab, 0, 0.01);
    EXPECT_NEAR(e1 / std::sqrt(e2 - e1 * e1), std::sqrt(M_PI / (4 - M_PI)), 0.02);
}

TEST(Speckle, NeighboursAreIndependentAcrossTheFacesToo) {
    const SpeckleVolume s = make_speckle(32, 3);
    const auto at = [&](int x, int y, int z) {
        return s.voxels[2 * ((x & 31) + 32 * ((y & 31) + 32 * (z & 31)))] / 32.0;
    };
    for (int axis = 0; axis < 3; ++axis) {
        double inner = 0, seam = 0;
        for (int i = 0; i < 32; ++i) {
            for (int j = 0; j < 32; ++j) {
                const auto p = [&](int k) {
                    return axis == 0 ? at(k, i, j) : axis == 1 ? at(i, k, j) : at(i, j, k);
                };
                inner += p(14) * p(15) / 1024;
                seam += p(31) * p(32) / 1024;
            }
        }
        EXPECT_NEAR(inner, 0, 4 / 32.0);  // four standard errors of 1024 products
        EXPECT_NEAR(seam, 0, 4 / 32.0);
    }
}

TEST(Speckle, SameBytesForAnyNumberOfThreads) {
    SpeckleVolume one, two;
    {
        const ThreadLimit limit(1);
        one = make_speckle(32, 5);
    }
    two = make_speckle(32, 5);
    EXPECT_EQ(one.voxels, two.voxels);
    EXPECT_NE(one.voxels, make_speckle(32, 6).voxels);
}

}  // namespace
}  // namespace sonocase::pipeline
