// SPDX-License-Identifier: Apache-2.0

#include "formats/exercise/pool_shift.h"
#include "support/hard_case.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>

namespace sonocase {
namespace {

using testing::HardCase;

// A ball of tissue around the pool is larger than it was by what was injected, less what the pool
// itself covers: 6.4 %, within the tenth that a trainee cannot see.
TEST(PoolShift, TissueMovesOutByTheVolumeOfThePool) {
    HardCase volume("volume that tissue moves out by, off", HardCase::at_most, 1e-6, "");
    for (const double radius : {0.5, 2.0, 7.8, 20.0})
        for (double radii = 1.0001; radii < kPoolFadesFrom; radii += 0.01) {
            const double r = radii * radius, rho = r * pool_share(r, radius);
            const double moved = (r * r * r - rho * rho * rho) / (radius * radius * radius);
            volume.see(std::abs(moved - (1 - std::pow(kPoolCore, 3))));
            EXPECT_GT(moved, 0.9);
            EXPECT_LE(moved, 1);
        }
}

TEST(PoolShift, IsOneToOneAndEndsWithoutAStep) {
    HardCase step("step where a pool's reach ends, of the distance", HardCase::at_most, 1e-6, "");
    for (const double radius : {0.4, 3.0, 12.0}) {
        double before = -1;
        for (double r = 0; r < 1.1 * kPoolReaches * radius; r += radius / 500) {
            const double rho = r * pool_share(r, radius);
            EXPECT_GT(rho, before) << r;
            // The steepest slope is that beside the pool: R^2 / (k R)^2.
            if (r > 0) {
                EXPECT_LT(rho - before, radius / 500 / (kPoolCore * kPoolCore) + 1e-9) << r;
            }
            before = rho;
        }
        EXPECT_EQ(pool_share(kPoolReaches * radius, radius), 1);
        step.see(std::abs(pool_share(0.999 * kPoolReaches * radius, radius) - 1));
    }
}

TEST(PoolShift, WhatIsNoPoolMovesNothing) {
    EXPECT_EQ(pool_share(1, 0), 1);
    EXPECT_EQ(pool_share(1, -3), 1);
    EXPECT_EQ(pool_share(0, NAN), 1);
    EXPECT_EQ(pool_share(NAN, 3), 1);
    EXPECT_EQ(pool_share(0.1, 0.9 * kMinPoolMm), 1);
    const std::array<SceneChange::Pool, 1> pools{{{{1, 2, 3}, 5, false}}};
    EXPECT_EQ(before_pools({}, {9, 9, 9}), (Point3{9, 9, 9}));
    EXPECT_EQ(before_pools(pools, {1, 2, 3}), (Point3{1, 2, 3}));  // where it was injected
}

}  // namespace
}  // namespace sonocase
