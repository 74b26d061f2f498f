// SPDX-License-Identifier: Apache-2.0

#include "formats/scoring/draw_attempt.h"

#include <gtest/gtest.h>

#include "formats/recording/session.h"

namespace sonocase {
namespace {

// A ball of radius 100 about the origin: organ (1) within 50 mm, flesh (2) outside of it, and a
// shell of bone (3) between 60 and 65 mm with a window towards +z whose half angle has the given
// cosine. Everything below y = -90 is cut off.
class WindowedBall final : public Anatomy {
  public:
    explicit WindowedBall(double window_cosine) : window_cosine_(window_cosine) {}
    bool inside(Point3 p) const override { return label(p) != 0; }
    int label(Point3 p) const override {
        const Vector3 v = p - Point3{};
        const double r = norm(v);
        if (!(r < 100)) return 0;
        if (r < 50) return 1;
        if (r > 60 && r < 65 && v.z < window_cosine_ * r) return 3;
        return 2;
    }
    double exit_distance(Point3 from, Vector3 d, double reach) const override {
        const Vector3 v = from - Point3{};
        const double b = dot(v, d), c = dot(v, v) - 1e4;
        return std::min(reach, -b + std::sqrt(std::max(b * b - c, 0.0)));
    }
    bool knows_tissue() const override { return true; }
    bool blocks_sound(int label) const override { return label == 3; }
    bool at_edge(Point3 p) const override { return p.y < -90; }

  private:
    double window_cosine_;
};

const std::vector<Label> kLabels{
    {"outside", "", 0, {}}, {"organ", "", 1, {}}, {"flesh", "", 2, {}}, {"bone", "", 3, {}}};

Exercise exercise() {
    Exercise e;
    Target target;
    target.name = "lesion";
    target.inside = "organ";
    target.radius_mm = 8;
    target.spread_mm = 30;
    e.targets = {target};
    e.start_probe = {0, 0, 100};
    e.start_beam = {0, 0, -1};
    e.start_spread_mm = 60;
    e.needle.length_mm = 200;
    e.probe.depth_mm = 180;
    return e;
}

TEST(DrawAttempt, SeedZeroIsTheExerciseAsWritten) {
    const WindowedBall body(-2);  // no bone
    const AttemptDraw drawn = draw_attempt(exercise(), body, kLabels, 0);
    EXPECT_EQ(drawn.exercise.targets[0].centre, Point3{});
    EXPECT_EQ(drawn.exercise.start_probe, (Point3{0, 0, 100}));
}

TEST(DrawAttempt, ASeedIsAPlaceAndSeedsDiffer) {
    const WindowedBall body(-2);
    Point3 before;
    for (std::uint64_t seed = 1; seed < 50; ++seed) {
        const AttemptDraw one = draw_attempt(exercise(), body, kLabels, seed);
        const AttemptDraw two = draw_attempt(exercise(), body, kLabels, seed);
        EXPECT_EQ(one.exercise.targets[0].centre, two.exercise.targets[0].centre);
        EXPECT_EQ(one.exercise.start_probe, two.exercise.start_probe);
        EXPECT_NE(one.exercise.targets[0].centre, before);
        before = one.exercise.targets[0].centre;
    }
}

TEST(DrawAttempt, TheTargetLiesInItsOrganClearOfOthersAndTheStartAwayFromIt) {
    const WindowedBall body(-2);
    double farthest = 0;
    for (std::uint64_t seed = 1; seed < 200; ++seed) {
        const AttemptDraw drawn = draw_attempt(exercise(), body, kLabels, seed);
        ASSERT_TRUE(drawn.warnings.empty()) << drawn.warnings[0];
        const Point3 p = drawn.exercise.targets[0].centre;
        EXPECT_LE(norm(p - Point3{}), 30);
        // 26 of the ball's directions are tried: between them it may bulge by a tenth.
        EXPECT_LE(norm(p - Point3{}), 50 - 0.9 * 8);
        farthest = std::max(farthest, norm(p - Point3{}));
        const Vector3 off = drawn.exercise.start_probe - Point3{0, 0, 100};
        const double beside = std::hypot(off.x, off.y);
        EXPECT_GE(beside, 30 - 1e-9);
        EXPECT_LE(beside, 60 + 1e-9);
        // Where the line from before the skin along the beam first meets it, in steps of 0.5 mm.
        EXPECT_NEAR(norm(drawn.exercise.start_probe - Point3{}), 100, 1);
        EXPECT_FALSE(body.at_edge(drawn.exercise.start_probe));
    }
    EXPECT_GT(farthest, 25);  // the whole region is used
}

// A window in the bone of 26 degrees about +z ends 44 mm beside it on the skin: beyond, the first
// picture would be black. Two of five lines 6 mm apart may still end on its rim.
TEST(DrawAttempt, TheStartShowsMoreThanARibsShadow) {
    const WindowedBall body(0.9);
    double farthest = 0;
    for (std::uint64_t seed = 1; seed < 60; ++seed) {
        const Point3 start = draw_attempt(exercise(), body, kLabels, seed).exercise.start_probe;
        farthest = std::max(farthest, std::hypot(start.x, start.y));
    }
    EXPECT_GT(farthest, 35);
    EXPECT_LT(farthest, 50);
    // Behind a closed shell every place is as good as another.
    const Point3 closed =
        draw_attempt(exercise(), WindowedBall(2), kLabels, 1).exercise.start_probe;
    EXPECT_GE(std::hypot(closed.x, closed.y), 30 - 1e-9);
}

// Easier attempts keep targets near their centre and the start near the target; harder ones start
// farther away.
TEST(DrawAttempt, AnEasierAttemptIsDrawnFromASmallerRegion) {
    const WindowedBall body(-2);
    double farthest_target[5] = {}, farthest_start[5] = {};
    for (int difficulty = kEasiest; difficulty <= kHardest; ++difficulty) {
        for (std::uint64_t place = 1; place < 60; ++place) {
            const AttemptDraw drawn =
                draw_attempt(exercise(), body, kLabels, seed_with_difficulty(place, difficulty));
            ASSERT_TRUE(drawn.warnings.empty()) << drawn.warnings[0];
            const Vector3 off = drawn.exercise.start_probe - Point3{0, 0, 100};
            const auto i = static_cast<std::size_t>(difficulty - kEasiest);
            farthest_start[i] = std::max(farthest_start[i], std::hypot(off.x, off.y));
            farthest_target[i] =
                std::max(farthest_target[i], norm(drawn.exercise.targets[0].centre - Point3{}));
        }
    }
    EXPECT_LE(farthest_target[0], 0.4 * 30);
    EXPECT_LE(farthest_target[1], 0.7 * 30);
    EXPECT_GT(farthest_target[2], 0.7 * 30);
    for (std::size_t i = 1; i < 5; ++i) EXPECT_GT(farthest_start[i], farthest_start[i - 1]) << i;
}

TEST(DrawAttempt, WhatNoNeedleReachesIsNotDrawn) {
    // Closed bone: nothing can be reached, the target stays, and a sentence says so.
    const AttemptDraw closed = draw_attempt(exercise(), WindowedBall(2), kLabels, 5);
    EXPECT_EQ(closed.exercise.targets[0].centre, Point3{});
    EXPECT_EQ(closed.warnings.size(), 1u);
    // A short needle reaches no farther than its length less the hand's 10 mm.
    Exercise shallow = exercise();
    shallow.needle.length_mm = 95;
    shallow.targets[0].spread_mm = 40;
    for (std::uint64_t seed = 1; seed < 50; ++seed) {
        const AttemptDraw drawn = draw_attempt(shallow, WindowedBall(-2), kLabels, seed);
        ASSERT_TRUE(drawn.warnings.empty());
        EXPECT_LE(100 - norm(drawn.exercise.targets[0].centre - Point3{}), 85);
    }
    // Everything beside the organ is to be spared: no needle reaches it.
    Exercise spared = exercise();
    spared.no_go = {"flesh"};
    EXPECT_EQ(draw_attempt(spared, WindowedBall(-2), kLabels, 5).warnings.size(), 1u);
}

TEST(DrawAttempt, AnOrganThatTheCaseLacksIsSaid) {
    Exercise lacking = exercise();
    lacking.targets[0].inside = "spleen";
    const AttemptDraw drawn = draw_attempt(lacking, WindowedBall(-2), kLabels, 5);
    ASSERT_EQ(drawn.warnings.size(), 1u);
    EXPECT_NE(drawn.warnings[0].find("lesion"), std::string::npos);
}

TEST(DrawAttempt, FreeFluidIsDrawnAnewAndChangesNothingElse) {
    Exercise plain = exercise(), wet = plain;
    wet.free_fluids.resize(2);
    wet.free_fluids[0].ml = 1000;
    wet.free_fluids[0].ml_spread = 0.3;
    wet.free_fluids[1].name = "rare";
    wet.free_fluids[1].ml = 10;
    wet.free_fluids[1].chance = 0.3;
    int rare = 0;
    double least = 1e9, most = 0;
    for (std::uint64_t seed = 1; seed <= 40; ++seed) {
        const AttemptDraw a = draw_attempt(plain, WindowedBall(-2), kLabels, seed),
                          b = draw_attempt(wet, WindowedBall(-2), kLabels, seed);
        EXPECT_TRUE(a.exercise.free_fluids.empty());
        rare += static_cast<int>(b.exercise.free_fluids.size()) - 1;
        EXPECT_EQ(distance(a.exercise.targets[0].centre, b.exercise.targets[0].centre), 0);
        least = std::min(least, b.exercise.free_fluids[0].ml);
        most = std::max(most, b.exercise.free_fluids[0].ml);
    }
    EXPECT_GE(least, 700);
    EXPECT_LT(least, 760);  // 40 draws leave out a tenth of the range once in 70 times
    EXPECT_LE(most, 1300);
    EXPECT_GT(most, 1240);
    EXPECT_NEAR(rare, 12, 9);  // three deviations of 40 draws
    const Exercise as_written = draw_attempt(wet, WindowedBall(-2), kLabels, 0).exercise;
    EXPECT_EQ(as_written.free_fluids[0].ml, 1000);
    EXPECT_EQ(as_written.free_fluids.size(), 2u);
}

TEST(AttemptSeed, IsReadFromTheHeaderAndIsZeroWhereThereIsNone) {
    SessionHeader header;
    EXPECT_EQ(attempt_seed(header), 0u);
    header.attempt = "mode=exam seed=18446744073709551615";
    EXPECT_EQ(attempt_seed(header), 18446744073709551615ull);
    for (const char* hostile : {"seed=", "seed=-1", "seed=1e9", "seed=99999999999999999999"}) {
        header.attempt = hostile;
        EXPECT_EQ(attempt_seed(header), 0u) << hostile;
    }
}

}  // namespace
}  // namespace sonocase
