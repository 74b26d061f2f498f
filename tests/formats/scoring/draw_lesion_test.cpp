// SPDX-License-Identifier: Apache-2.0

#include "formats/scoring/draw_lesion.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "formats/pathology/pathology_kinds.h"
#include "formats/scoring/draw_attempt.h"

namespace sonocase {
namespace {

// A ball of tissue about the origin: organ (1) within 50 mm, flesh (2) to 100 mm.
class PlainBall final : public Anatomy {
  public:
    bool inside(Point3 p) const override { return label(p) != 0; }
    int label(Point3 p) const override {
        const double r = norm(p - Point3{});
        return r < 50 ? 1 : r < 100 ? 2 : 0;
    }
    double exit_distance(Point3 from, Vector3 d, double reach) const override {
        const Vector3 v = from - Point3{};
        const double b = dot(v, d), c = dot(v, v) - 1e4;
        return std::min(reach, -b + std::sqrt(std::max(b * b - c, 0.0)));
    }
    bool knows_tissue() const override { return true; }
};

const std::vector<Label> kLabels{
    {"outside", "", 0, {}}, {"organ", "", 1, {}}, {"flesh", "", 2, {}}};

Finding finding(const std::string& kind, double radius_mm) {
    Finding f;
    f.lesion.name = kind;
    f.lesion.look = TargetLook::lesion;
    f.lesion.kind = kind;
    f.lesion.inside = "organ";
    f.lesion.radius_mm = radius_mm;
    f.lesion.spread_mm = 40;
    return f;
}

Exercise exercise() {
    Exercise e;
    Target target = finding("metastasis", 8).lesion;
    e.targets = {target};
    e.findings = {finding("simple_cyst", 6), finding("lymph_node", 5)};
    e.start_probe = {0, 0, 100};
    e.start_beam = {0, 0, -1};
    e.start_spread_mm = 60;
    e.needle.length_mm = 200;
    e.probe.depth_mm = 180;
    return e;
}

// Volume is that of the ball, axes are at right angles and within what the kind allows.
TEST(DrawLesion, AxesKeepVolumeAndTheKindsElongation) {
    for (const std::string& name : kinds_drawn_per_attempt()) {
        const PathologyKind& kind = *find_pathology_kind(name);
        RandomStream draws(7);
        for (int n = 0; n < 200; ++n) {
            const LesionAxes axes = draw_axes(finding(name, 5).lesion, draws);
            const Vector3 l = axes.lengths;
            EXPECT_NEAR(l.x * l.y * l.z, 1, 1e-12) << name;
            EXPECT_LT(orthonormality_error(axes.axes), 1e-12);
            const double aside = std::cbrt(kind.aspect);
            for (const double axis : {l.x * aside / kind.aspect, l.y * aside, l.z * aside}) {
                EXPECT_GE(axis, 1 / kind.elongation - 1e-12) << name;
                EXPECT_LE(axis, kind.elongation + 1e-12) << name;
            }
        }
    }
    // Nothing is drawn for a plain target: it stays a ball.
    RandomStream draws(7);
    EXPECT_EQ(draw_axes(Target{}, draws).lengths, (Vector3{1, 1, 1}));
}

TEST(DrawLesion, FindingsLieInTheirOrganClearOfTargetsAndOfEachOther) {
    const PlainBall body;
    Point3 before;
    for (std::uint64_t seed = 1; seed < 200; ++seed) {
        const AttemptDraw drawn = draw_attempt(exercise(), body, kLabels, seed);
        ASSERT_TRUE(drawn.warnings.empty()) << drawn.warnings[0];
        const std::vector<Target> shown = shown_lesions(drawn.exercise);
        ASSERT_EQ(shown.size(), 3u);
        EXPECT_EQ(shown.back().name, "metastasis");  // the target is drawn over findings
        for (std::size_t i = 0; i < shown.size(); ++i) {
            // Tried in 26 directions: between them it may bulge by a tenth.
            EXPECT_LE(norm(shown[i].centre - Point3{}), 50 - 0.9 * outer_radius_mm(shown[i]));
            for (std::size_t j = 0; j < i; ++j) {
                const double room = outer_radius_mm(shown[i]) + outer_radius_mm(shown[j]);
                EXPECT_GE(distance(shown[i].centre, shown[j].centre), room) << seed;
            }
        }
        EXPECT_NE(shown[0].centre, before);
        before = shown[0].centre;
        const AttemptDraw again = draw_attempt(exercise(), body, kLabels, seed);
        EXPECT_EQ(again.exercise.findings[1].lesion.centre, shown[1].centre);
        EXPECT_EQ(again.exercise.findings[1].lesion.axes.axes, shown[1].axes.axes);
    }
}

// Targets and start come from a stream of their own: findings beside them change neither, so that
// recordings of exercises that gain findings keep their targets.
TEST(DrawLesion, FindingsDoNotMoveTargets) {
    const PlainBall body;
    Exercise alone = exercise();
    alone.findings.clear();
    for (std::uint64_t seed = 1; seed < 50; ++seed) {
        const Exercise with = draw_attempt(exercise(), body, kLabels, seed).exercise;
        const Exercise without = draw_attempt(alone, body, kLabels, seed).exercise;
        EXPECT_EQ(with.targets[0].centre, without.targets[0].centre);
        EXPECT_EQ(with.start_probe, without.start_probe);
    }
}

TEST(DrawLesion, ChanceAndRadiusAreDrawn) {
    const PlainBall body;
    Exercise e = exercise();
    e.findings = {finding("haemangioma", 5)};
    e.findings[0].chance = 0.3;
    e.findings[0].radius_spread = 0.4;
    int present = 0;
    double smallest = 100, largest = 0;
    for (std::uint64_t seed = 1; seed <= 1000; ++seed) {
        const Exercise drawn = draw_attempt(e, body, kLabels, seed).exercise;
        if (drawn.findings.empty()) continue;
        ++present;
        smallest = std::min(smallest, drawn.findings[0].lesion.radius_mm);
        largest = std::max(largest, drawn.findings[0].lesion.radius_mm);
    }
    EXPECT_NEAR(present, 300, 58);  // four deviations of a binomial
    EXPECT_GE(smallest, 3);
    EXPECT_LT(smallest, 3.2);
    EXPECT_LE(largest, 7);
    EXPECT_GT(largest, 6.8);
}

TEST(DrawLesion, AFindingWithoutRoomIsLeftOutAndSaid) {
    Exercise e = exercise();
    e.findings[0].lesion.radius_mm = 60;  // larger than the organ
    const AttemptDraw drawn = draw_attempt(e, PlainBall(), kLabels, 3);
    ASSERT_EQ(drawn.warnings.size(), 1u);
    EXPECT_NE(drawn.warnings[0].find("'simple_cyst'"), std::string::npos);
    ASSERT_EQ(drawn.exercise.findings.size(), 1u);
    EXPECT_EQ(drawn.exercise.findings[0].lesion.name, "lymph_node");
}

TEST(DrawLesion, SeedZeroShowsEveryFindingAsWritten) {
    Exercise e = exercise();
    e.findings[0].chance = 0.01;
    const AttemptDraw drawn = draw_attempt(e, PlainBall(), kLabels, 0);
    ASSERT_EQ(drawn.exercise.findings.size(), 2u);
    EXPECT_EQ(drawn.exercise.findings[0].lesion.centre, Point3{});
}

}  // namespace
}  // namespace sonocase
