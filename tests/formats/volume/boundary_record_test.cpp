// SPDX-License-Identifier: Apache-2.0

#include "formats/volume/boundary_record.h"

#include <gtest/gtest.h>

#include "support/random.h"

namespace sonocase {
namespace {

TEST(BoundaryRecord, RoundTripWithinTheStatedRounding) {
    testing::Random random(8);
    double worst_angle = 0;
    for (int i = 0; i < 20000; ++i) {
        const BoundaryRecord in{static_cast<std::uint8_t>(i % 255), random.uniform(-2.6, 2.6),
                                random.direction()};
        const std::uint32_t packed = pack_boundary(in);
        ASSERT_NE(packed, kNoBoundary);
        const BoundaryRecord out = unpack_boundary(packed);
        EXPECT_EQ(out.second_label, in.second_label);
        EXPECT_NEAR(out.distance_vx, in.distance_vx, 0.5 / kBoundaryStepsPerVoxel + 1e-12);
        worst_angle = std::max(worst_angle, std::acos(std::min(1.0, dot(in.normal, out.normal))));
    }
    EXPECT_LT(worst_angle, 1.0 * kRadPerDeg);
}

TEST(BoundaryRecord, DistanceIsClampedNotWrapped) {
    EXPECT_GT(unpack_boundary(pack_boundary({1, 100, {1, 0, 0}})).distance_vx, 2.6);
    EXPECT_LT(unpack_boundary(pack_boundary({1, -100, {1, 0, 0}})).distance_vx, -2.6);
}

TEST(BoundaryRecord, AxesAreExact) {
    for (const Vector3 n : {Vector3{1, 0, 0}, Vector3{-1, 0, 0}, Vector3{0, 1, 0},
                            Vector3{0, -1, 0}, Vector3{0, 0, 1}, Vector3{0, 0, -1}}) {
        const Vector3 out = unpack_boundary(pack_boundary({0, 0, n})).normal;
        EXPECT_NEAR(dot(out, n), 1, 1e-12);
    }
}

}  // namespace
}  // namespace sonocase
