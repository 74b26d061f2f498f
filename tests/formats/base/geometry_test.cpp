// SPDX-License-Identifier: Apache-2.0

#include "formats/base/geometry.h"
#include "formats/base/constants.h"

#include <gtest/gtest.h>

#include "support/random.h"

namespace sonocase {
namespace {

using testing::Random;

TEST(Geometry, RigidInverseUndoesTheMotion) {
    Random random(1);
    for (int i = 0; i < 200; ++i) {
        const Rigid t = random.rigid(1000);
        const Point3 p = random.point(1000);
        // A thousand millimetres carried through two rotations: a few units in the last place.
        EXPECT_LT(distance(inverse(t) * (t * p), p), 1e-11);
    }
}

TEST(Geometry, RotationAngleIsAccurateAtBothEnds) {
    Random random(2);
    for (double angle : {0.0, 1e-12, 1e-8, 1e-3, 1.0, kPi - 1e-3, kPi - 1e-8, kPi}) {
        const Matrix3 r = rotation_about(random.direction(), angle);
        EXPECT_NEAR(rotation_angle(r), angle, 1e-14 + 1e-15) << angle;
        EXPECT_LT(orthonormality_error(r), 1e-15 * 8);
    }
}

TEST(Geometry, QuaternionRoundTripAtHardAngles) {
    Random random(3);
    for (int i = 0; i < 300; ++i) {
        const double angle = i < 100 ? random.uniform(0, kPi) : i < 200 ? kPi - 1e-9 * i : 1e-9 * i;
        const Matrix3 r = rotation_about(random.direction(), angle);
        const Matrix3 back = rotation_from_quaternion(quaternion_from_rotation(r));
        for (std::size_t k = 0; k < 9; ++k) EXPECT_NEAR(back.m[k], r.m[k], 1e-14);
    }
}

TEST(Geometry, NearestRotationUndoesSmallDamageAndIsARotation) {
    Random random(4);
    for (int i = 0; i < 100; ++i) {
        const Matrix3 r = random.rotation();
        Matrix3 damaged = r;
        for (double& v : damaged.m) v += random.uniform(-1e-3, 1e-3);
        const Matrix3 fixed = nearest_rotation(damaged);
        EXPECT_LT(orthonormality_error(fixed), 1e-14);
        EXPECT_GT(determinant(fixed), 0);
        EXPECT_LT(rotation_angle(transpose(r) * fixed), 5e-3);
    }
}

TEST(Geometry, NormalizedSurvivesTinyAndHugeVectors) {
    EXPECT_DOUBLE_EQ(norm(normalized({3e-300, 4e-300, 0})), 1);
    EXPECT_DOUBLE_EQ(norm(normalized({3e300, 4e300, 0})), 1);
    EXPECT_EQ(normalized({0, 0, 0}), (Vector3{0, 0, 0}));
}

TEST(Geometry, MatrixInverseTimesMatrixIsIdentity) {
    Random random(5);
    for (int i = 0; i < 100; ++i) {
        Matrix3 a = random.rotation();
        for (double& v : a.m) v += random.uniform(-0.2, 0.2);
        const Matrix3 one = a * inverse(a);
        for (int r = 0; r < 3; ++r) {
            for (int c = 0; c < 3; ++c) EXPECT_NEAR(one(r, c), r == c ? 1 : 0, 1e-13);
        }
    }
}

TEST(Geometry, AnyPerpendicularIsUnitAndOrthogonal) {
    Random random(6);
    for (int i = 0; i < 100; ++i) {
        const Vector3 a = i == 0 ? Vector3{1, 0, 0} : random.direction();
        const Vector3 b = any_perpendicular(a);
        EXPECT_NEAR(dot(a, b), 0, 1e-15);
        EXPECT_NEAR(norm(b), 1, 1e-15);
    }
}

}  // namespace
}  // namespace sonocase
