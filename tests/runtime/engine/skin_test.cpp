// SPDX-License-Identifier: Apache-2.0

#include "runtime/engine/skin.h"

#include <gtest/gtest.h>

#include <limits>

#include "support/small_case.h"

namespace sonocase::runtime {
namespace {

class SkinOfCylinder : public ::testing::Test {
  protected:
    CaseBundle bundle_ = sonocase::testing::small_case();
    Skin skin_{bundle_};
};

// The body is drawn in voxels of 2 mm: its surface is within half a voxel's diagonal of the
// cylinder.
constexpr double kVoxelError = 1.8;

TEST_F(SkinOfCylinder, IsEnteredAtTheRadiusFromEverySide) {
    for (int i = 0; i < 12; ++i) {
        const double angle = i * 0.5235987755982988;
        const Vector3 out{std::cos(angle), 0, std::sin(angle)};
        const auto touch = skin_.enter(Point3{0, 0, 0} + 90 * out, -out, 90);
        ASSERT_TRUE(touch.has_value()) << angle;
        EXPECT_NEAR(std::hypot(touch->x, touch->z), 60, kVoxelError);
    }
}

TEST_F(SkinOfCylinder, NormalPointsOut) {
    for (int i = 0; i < 12; ++i) {
        const double angle = 0.1 + i * 0.5235987755982988;
        const Vector3 out{std::cos(angle), 0, std::sin(angle)};
        // 10 degrees: what is left of the staircase over a ball of 12 mm.
        EXPECT_GT(dot(skin_.normal(Point3{0, 0, 0} + 60 * out), out), std::cos(0.175)) << angle;
    }
}

TEST_F(SkinOfCylinder, IsNotMetWhereTheRayMissesOrStartsInside) {
    EXPECT_FALSE(skin_.enter({0, 0, 90}, {0, 0, 1}, 100));
    EXPECT_FALSE(skin_.enter({90, 0, 90}, {0, 1, 0}, 100));
    EXPECT_FALSE(skin_.enter({0, 0, 0}, {0, 0, 1}, 100));
}

TEST_F(SkinOfCylinder, IsProjectedOntoFromEitherSide) {
    for (double z : {45.0, 58.0, 62.0, 75.0}) {
        const auto touch = skin_.project({0, 0, z}, {0, 0, -1}, 40);
        ASSERT_TRUE(touch.has_value()) << z;
        EXPECT_NEAR(touch->z, 60, kVoxelError);
    }
}

TEST_F(SkinOfCylinder, HasNoBodyAtPointsThatAreNotNumbers) {
    const double nan = std::numeric_limits<double>::quiet_NaN();
    EXPECT_FALSE(skin_.inside({nan, 0, 0}));
    EXPECT_FALSE(skin_.inside({0, INFINITY, 0}));
    EXPECT_FALSE(skin_.inside({-1e300, 0, 0}));
}

}  // namespace
}  // namespace sonocase::runtime
