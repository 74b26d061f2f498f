// SPDX-License-Identifier: Apache-2.0

#include "runtime/tracking/mouse_tracker.h"

#include <gtest/gtest.h>

#include "support/small_case.h"

namespace sonocase::runtime {
namespace {

class MouseOnCylinder : public ::testing::Test {
  protected:
    CaseBundle bundle_ = sonocase::testing::small_case();
    Skin skin_{bundle_};
    Exercise exercise_ = sonocase::testing::small_exercise();
    MouseTracker mouse_{skin_, exercise_};

    Point3 face() const { return mouse_.mannequin_from_probe() * Point3{0, 0, 0}; }
    Vector3 beam() const { return mouse_.mannequin_from_probe().rotation.column(2); }
};

TEST_F(MouseOnCylinder, StartsOnTheSkinLookingIn) {
    EXPECT_NEAR(face().z, 59, 1.8);  // 1 mm pressed in; half a voxel's diagonal
    EXPECT_GT(dot(beam(), {0, 0, -1}), 0.98);
    EXPECT_TRUE(mouse_.in_contact());
}

// The plane in which an exercise begins is the exercise's: across the cylinder, or along it.
TEST_F(MouseOnCylinder, StartsInThePlaneOfTheExercise) {
    for (const Vector3 lateral : {Vector3{1, 0, 0}, Vector3{0, 1, 0}, Vector3{0, -1, 0.5}}) {
        exercise_.start_lateral = lateral;
        const MouseTracker mouse(skin_, exercise_);
        const Vector3 x = mouse.mannequin_from_probe().rotation.column(0);
        EXPECT_GT(dot(x, normalized({lateral.x, lateral.y, 0})), 0.98) << lateral.y;
    }
}

TEST_F(MouseOnCylinder, KeepsContactNormalAndRadiusAllTheWayRound) {
    for (int i = 0; i < 200; ++i) {
        mouse_.slide(2, 0);
        const Point3 p = face();
        EXPECT_NEAR(std::hypot(p.x, p.z), 59, 2.5) << i;
        const Vector3 out = normalized(Vector3{p.x, 0, p.z});
        EXPECT_GT(dot(beam(), -out), 0.97) << i;
        EXPECT_LT(orthonormality_error(mouse_.mannequin_from_probe().rotation), 1e-9);
    }
    // 400 mm is more than the circumference of 377 mm: it went round and did not drift along the
    // axis.
    EXPECT_LT(std::abs(face().y), 15);
}

TEST_F(MouseOnCylinder, StopsAtTheEdgeOfTheBody) {
    for (int i = 0; i < 100; ++i) mouse_.slide(0, 5);
    EXPECT_LE(std::abs(face().y), 81);
    EXPECT_GT(std::abs(face().y), 60);
    EXPECT_NEAR(std::hypot(face().x, face().z), 59, 2.5);
    EXPECT_GT(dot(beam(), {0, 0, -1}), 0.95);  // the cut face is not skin
}

TEST_F(MouseOnCylinder, TurnsAboutTheFace) {
    const Point3 before = face();
    mouse_.rock(0.3);
    mouse_.fan(-0.2);
    mouse_.rotate(0.5);
    EXPECT_LT(distance(face(), before), 1e-9);
    EXPECT_NEAR(std::acos(dot(beam(), {0, 0, -1})), std::acos(std::cos(0.3) * std::cos(0.2)), 0.1);
    for (int i = 0; i < 100; ++i) mouse_.rock(0.3);
    EXPECT_GT(dot(beam(), {0, 0, -1}), 0);  // the tilt is limited
}

TEST_F(MouseOnCylinder, LiftsOffAndComesBack) {
    mouse_.press(-8);
    EXPECT_FALSE(mouse_.in_contact());
    EXPECT_GT(face().z, 60);
    mouse_.press(9);
    EXPECT_TRUE(mouse_.in_contact());
    for (int i = 0; i < 100; ++i) mouse_.press(5);
    EXPECT_LE(mouse_.press_mm(), 12);
}

TEST_F(MouseOnCylinder, HandsOverOnlyChanges) {
    TrackerReading reading;
    EXPECT_TRUE(mouse_.poll(1, reading));
    EXPECT_FALSE(mouse_.poll(2, reading));
    mouse_.rock(0.01);
    EXPECT_TRUE(mouse_.poll(3, reading));
    EXPECT_TRUE(reading.in_mannequin);
    EXPECT_EQ(reading.sensors[kNeedleSensor].state, SensorState::absent);
}

// So that D, which aims by a positive angle, moves the tip to the right of the picture.
TEST_F(MouseOnCylinder, APositiveAngleInThePlaneMovesTheTipTowardsX) {
    ASSERT_TRUE(mouse_.place_needle_beside_probe(30, true));
    mouse_.advance_needle(40);
    const auto tip_x = [&] {
        return (inverse(mouse_.mannequin_from_probe()) * mouse_.mannequin_from_needle() *
                Point3{0, 0, 0})
            .x;
    };
    const double before = tip_x();
    mouse_.aim_needle(0.05, 0);
    EXPECT_GT(tip_x(), before + 1);
}

TEST_F(MouseOnCylinder, NeedleKeepsItsEntryWhileAimedAndAdvanced) {
    ASSERT_TRUE(mouse_.place_needle_beside_probe(30, true));
    const Point3 entry = mouse_.needle_entry();
    mouse_.advance_needle(45);
    EXPECT_DOUBLE_EQ(mouse_.needle_depth_mm(), 40);
    mouse_.aim_needle(0.1, -0.05);
    EXPECT_EQ(mouse_.needle_entry(), entry);
    const Rigid needle = mouse_.mannequin_from_needle();
    EXPECT_NEAR(distance(needle * Point3{0, 0, 0}, entry), 40, 1e-9);
    EXPECT_NEAR(distance(needle * Point3{0, 0, -40}, entry), 0, 1e-9);  // z runs from hub to tip
    mouse_.slide_needle(10, 0);
    EXPECT_EQ(mouse_.needle_entry(), entry);  // not sideways through tissue
    mouse_.advance_needle(1e6);
    EXPECT_EQ(mouse_.needle_depth_mm(), exercise_.needle.length_mm);
    mouse_.withdraw_needle();
    EXPECT_FALSE(mouse_.has_needle());
}

TEST(MouseTracker, FindsTheSkinFromABadStart) {
    const CaseBundle bundle = sonocase::testing::small_case();
    const Skin skin(bundle);
    for (const Point3 start : {Point3{0, 0, 0}, Point3{0, 0, 300}, Point3{20, 10, 61}}) {
        Exercise exercise = sonocase::testing::small_exercise();
        exercise.start_probe = start;
        const MouseTracker mouse(skin, exercise);
        const Point3 p = mouse.mannequin_from_probe() * Point3{0, 0, 0};
        EXPECT_NEAR(std::hypot(p.x, p.z), 59, 2.5) << start.z;
    }
}

}  // namespace
}  // namespace sonocase::runtime
