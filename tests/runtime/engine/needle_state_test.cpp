// SPDX-License-Identifier: Apache-2.0

#include "runtime/engine/needle_state.h"

#include <gtest/gtest.h>

#include "support/random.h"

namespace sonocase::runtime {
namespace {

// Body: everything below z = 0.
class Floor final : public Anatomy {
  public:
    bool inside(Point3 p) const override { return p.z < 0; }
    double exit_distance(Point3 from, Vector3 direction, double reach) const override {
        return direction.z > 0 ? std::min(reach, -from.z / direction.z) : reach;
    }
};
const Floor kFloor;

Rigid needle_at(Point3 tip, Vector3 direction) {
    const Vector3 z = normalized(direction), x = any_perpendicular(z);
    return {Matrix3::from_columns(x, cross(z, x), z), tip - Point3{}};
}
Point3 tip_of(const Rigid& t) {
    return {t.translation.x, t.translation.y, t.translation.z};
}

TEST(NeedleState, IsTheMeasuredNeedleOutsideTheBody) {
    NeedleState state(&kFloor, {});
    const Rigid measured = needle_at({1, 2, 30}, {0.1, 0, -1});
    const NeedleView view = state.update(0, measured);
    EXPECT_EQ(view.mannequin_from_drawn, measured);
    EXPECT_FALSE(view.inserted);
    EXPECT_EQ(view.depth_mm, 0);
    NeedleState free(nullptr, {});
    EXPECT_EQ(free.update(0, measured).mannequin_from_drawn, measured);
}

TEST(NeedleState, AStraightNeedleIsDrawnAsMeasuredAtEveryDepth) {
    NeedleState state(&kFloor, {});
    const Vector3 d = normalized({0.3, -0.2, -1});
    for (int i = 0; i <= 300; ++i) {
        const Rigid measured = needle_at(Point3{0, 0, 0} + (0.5 * i - 5) * d, d);
        const NeedleView view = state.update(i * 0.02, measured);
        EXPECT_LT(distance(tip_of(view.mannequin_from_drawn), tip_of(measured)), 1e-9) << i;
        EXPECT_NEAR(dot(view.mannequin_from_drawn.rotation.column(2), d), 1, 1e-12);
        EXPECT_EQ(view.inserted, 0.5 * i - 5 >= 2 - 1e-9) << i;
    }
}

TEST(NeedleState, ABentHandleMovesTheTipLessTheDeeperTheNeedleIs) {
    double last_share = 1;
    for (const double depth : {10.0, 60.0, 120.0, 180.0}) {
        NeedleModel model;
        model.length_mm = 250;
        NeedleState state(&kFloor, model);
        const Vector3 d{0, 0, -1};
        double t = 0;
        for (double z = -1; z <= depth; z += 0.5) state.update(t += 0.02, needle_at({0, 0, -z}, d));
        // The handle is tilted by 5 degrees about the point 30 mm above the skin.
        const Vector3 bent{std::sin(0.087), 0, -std::cos(0.087)};
        const Rigid measured = needle_at(Point3{0, 0, 30} + (depth + 30) * bent, bent);
        const NeedleView view = state.update(t += 0.02, measured);
        const double moved = distance(tip_of(view.mannequin_from_drawn), {0, 0, -depth});
        const double share = moved / distance(tip_of(measured), {0, 0, -depth});
        EXPECT_LT(share, last_share) << depth;
        EXPECT_LT(orthonormality_error(view.mannequin_from_drawn.rotation), 1e-12);
        last_share = share;
    }
    EXPECT_LT(last_share, 0.05);
}

TEST(NeedleState, EveryInsertionHasItsOwnEntry) {
    NeedleState state(&kFloor, {});
    double t = 0;
    const auto push = [&](Vector3 d, double from, double to) {
        int entries = 0;
        for (double s = from; from < to ? s < to : s > to; s += from < to ? 0.5 : -0.5) {
            if (state.update(t += 0.02, needle_at(Point3{} + s * d, d)).change ==
                InsertionChange::entered) {
                ++entries;
            }
        }
        return entries;
    };
    const Vector3 first = normalized({0.2, 0, -1}), second = normalized({-0.4, 0.1, -1});
    EXPECT_EQ(push(first, -10, 60), 1);
    EXPECT_EQ(push(first, 60, -20), 0);
    EXPECT_EQ(push(second, -20, 60), 1);
    EXPECT_EQ(state.insertions().insertions(), 2);
    EXPECT_NEAR(dot(state.insertions().entry_direction(), second), 1, 1e-12);
}

TEST(NeedleState, PosesThatAreNoneAreHandedThrough) {
    NeedleState state(&kFloor, {});
    Rigid bad;
    bad.translation.x = NAN;
    const NeedleView view = state.update(0, bad);
    EXPECT_FALSE(view.inserted);
}

}  // namespace
}  // namespace sonocase::runtime
