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

TEST(Camera, ThePatientStandsUprightAndIsSeenFromTheSideOfTheProbe) {
    BodyAxes axes;
    axes.known = true;
    axes.right = {-1, 0, 0};
    axes.head = {0, 1, 0};
    axes.front = {0, 0, 1};
    Exercise exercise;
    exercise.start_probe = {-80, 0, 40};
    exercise.start_beam = normalized(Vector3{1, 0, -0.4});  // from the right flank
    const HomeView view = home_view({{-100, -200, -80}, {100, 200, 80}}, exercise, axes);
    const Rigid camera = mannequin_from_outside_camera(view.home, view.interest, view.orbit);
    expect_right_handed(camera);
    const Point3 head = seen(camera, {0, 150, 0}), feet = seen(camera, {0, -150, 0}),
                 probe = seen(camera, exercise.start_probe), across = seen(camera, {80, 0, -40});
    EXPECT_GT(head.y, feet.y + 200);
    EXPECT_NEAR(head.x, feet.x, 1);
    EXPECT_GT(probe.z, across.z);  // nearer to the eye
}

TEST(Camera, TheCubeShowsTheSidesThatFaceTheEye) {
    BodyAxes axes;
    axes.known = true;
    sonocase::testing::Random random(5);
    const Vector3 sides[] = {axes.right,  -axes.right, axes.front,
                             -axes.front, axes.head,   -axes.head};
    const Matrix3 home = Matrix3::from_columns(-axes.right, axes.head, axes.front);
    for (const Vector3& side : sides) {
        const Rigid camera =
            mannequin_from_outside_camera(home, {}, orbit_towards(home, side, 500));
        const auto faces = cube_faces(inverse(camera).rotation, axes);
        ASSERT_FALSE(faces.empty());
        EXPECT_GT(dot(faces.back().outward, side), 0.99);  // the nearest one is drawn last
        EXPECT_GT(faces.back().towards_eye, 0.99);
    }
    for (int i = 0; i < 20; ++i) {
        const auto faces = cube_faces(random.rigid(10).rotation, axes);
        EXPECT_LE(faces.size(), 3u);
        for (const CubeFace& face : faces)
            for (const auto& corner : face.corners)
                EXPECT_LE(std::max(std::abs(corner[0]), std::abs(corner[1])), 1.0);
    }
}

}  // namespace
}  // namespace sonocase::runtime
