// SPDX-License-Identifier: Apache-2.0

#include "runtime/display/models/camera.h"

#include <gtest/gtest.h>

#include "support/random.h"

namespace sonocase::runtime {
namespace {

// In the camera's frame x is right and y up; what is in view has negative z.
Point3 seen(const Rigid& mannequin_from_camera, Point3 p) {
    return inverse(mannequin_from_camera) * p;
}

void expect_right_handed(const Rigid& r) {
    EXPECT_NEAR(dot(cross(r.rotation.column(0), r.rotation.column(1)), r.rotation.column(2)), 1,
                1e-12);
}

TEST(Camera, FromTheProbeThePictureIsBeforeItAndTheRightWayRound) {
    sonocase::testing::Random random(3);
    for (int i = 0; i < 50; ++i) {
        const Rigid probe = random.rigid(300);
        const Rigid camera = mannequin_from_probe_camera(probe);
        expect_right_handed(camera);
        const Point3 face = seen(camera, probe * Point3{0, 0, 0});
        const Point3 deep = seen(camera, probe * Point3{0, 0, 100});
        const Point3 mark = seen(camera, probe * Point3{30, 0, 50});
        EXPECT_LT(face.z, 0);
        EXPECT_LT(deep.z, 0);
        EXPECT_GT(face.y, deep.y);  // depth runs downwards
        EXPECT_GT(mark.x, 10);      // the mark's side is on the right
    }
}

TEST(Camera, FromTheNeedleTheTipIsBeforeItAndTheWayGoesAhead) {
    sonocase::testing::Random random(4);
    for (int i = 0; i < 50; ++i) {
        const Rigid needle = random.rigid(300);
        const Rigid camera = mannequin_from_needle_camera(needle);
        expect_right_handed(camera);
        const Point3 tip = seen(camera, needle * Point3{0, 0, 0});
        const Point3 ahead = seen(camera, needle * Point3{0, 0, 60});
        EXPECT_LT(tip.z, -50);
        EXPECT_LT(ahead.z, tip.z - 50);
        EXPECT_LT(std::hypot(tip.x, tip.y), 30);
    }
}

TEST(Camera, FromOutsideItLooksAtThePointOfInterest) {
    const Rigid camera = mannequin_from_outside_camera(
        Matrix3{}, {10, 20, 30}, {.yaw_rad = 0.4, .pitch_rad = -0.3, .distance_mm = 500});
    const Point3 middle = seen(camera, {10, 20, 30});
    EXPECT_NEAR(middle.x, 0, 1e-9);
    EXPECT_NEAR(middle.y, 0, 1e-9);
    EXPECT_NEAR(middle.z, -500, 1e-9);
}

}  // namespace
}  // namespace sonocase::runtime
