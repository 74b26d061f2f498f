// SPDX-License-Identifier: Apache-2.0

#include "formats/scoring/sight.h"

#include <gtest/gtest.h>

#include "formats/scoring/session_score.h"

namespace sonocase {
namespace {

// Flesh below z = 0, air above; a rib of radius 4 along y at (10, *, -20); a breath moves all.
class Rib final : public Anatomy {
  public:
    explicit Rib(double shift_mm = 0) : shift_mm_(shift_mm) {}
    bool inside(Point3 p) const override { return p.z < 0; }
    int label(Point3 p) const override {
        if (!inside(p)) return 0;
        return std::hypot(p.x - 10, p.z + 20) < 4 ? 2 : 1;
    }
    double exit_distance(Point3 from, Vector3 d, double reach) const override {
        return d.z > 0 ? std::min(reach, -from.z / d.z) : reach;
    }
    Point3 at_rest(Point3 p, Vector3) const override { return p - Vector3{shift_mm_, 0, 0}; }
    bool knows_tissue() const override { return true; }
    bool blocks_sound(int label) const override { return label == 2; }

  private:
    double shift_mm_;
};

Probe linear() {
    Probe probe;
    probe.shape = ProbeShape::linear;
    probe.width_mm = 60;
    probe.depth_mm = 80;
    return probe;
}
// Looking straight down from height z.
Rigid down(double z) {
    return {Matrix3::from_columns({1, 0, 0}, {0, -1, 0}, {0, 0, -1}), {0, 0, z}};
}

TEST(Sight, ARibHidesWhatLiesBehindItAndNothingElse) {
    const Rib rib;
    EXPECT_TRUE(sound_reaches(rib, linear(), down(0), {0, 0, 40}, 0));
    EXPECT_FALSE(sound_reaches(rib, linear(), down(0), {10, 0, 40}, 0));
    EXPECT_TRUE(sound_reaches(rib, linear(), down(0), {10, 0, 12}, 0));  // before it
    EXPECT_FALSE(sound_reaches(Rib(20), linear(), down(0), {30, 0, 40}, 0));
    EXPECT_TRUE(sound_reaches(Rib(20), linear(), down(0), {10, 0, 40}, 0));
}

TEST(Sight, OfACurvedFaceTheShadowFollowsTheScanline) {
    const Rib rib;
    Probe probe = linear();
    probe.shape = ProbeShape::curvilinear;
    probe.radius_mm = 50;
    probe.field_of_view_rad = 1.2;
    // The rib's middle is at (10, 20): on its scanline x = 10 (z + 50) / 70.
    EXPECT_FALSE(sound_reaches(rib, probe, down(0), {10.0 * 110 / 70, 0, 60}, 0));
    EXPECT_TRUE(sound_reaches(rib, probe, down(0), {9, 0, 75}, 0));
}

// As the picture closes it: 10 mm under a flat face, 25 under a curved one.
TEST(Sight, ContactClosesTheGapThatThePictureCloses) {
    const Rib rib;
    EXPECT_TRUE(sound_reaches(rib, linear(), down(9), {0, 0, 40}, 0));
    EXPECT_FALSE(sound_reaches(rib, linear(), down(12), {0, 0, 40}, 0));
    Probe curved = linear();
    curved.shape = ProbeShape::curvilinear;
    curved.radius_mm = 60;
    curved.field_of_view_rad = 1.1;
    EXPECT_TRUE(sound_reaches(rib, curved, down(20), {0, 0, 60}, 0));
    EXPECT_FALSE(sound_reaches(rib, curved, down(28), {0, 0, 60}, 0));
}

Exercise with_linear_probe() {
    Exercise exercise;
    exercise.probe = linear();
    return exercise;
}

constexpr Vector3 kBevel{0, 0, -1};  // towards the probe

TEST(NeedleSight, LengthInTheShadowDoesNotCount) {
    const Rib rib;
    const NeedleSight sight(&rib, with_linear_probe());
    // Across the picture at a depth of 40: 60 mm of width, 8 of them behind the rib. Its edges are
    // thin, and the penumbra of the aperture reaches in by 2 mm from each side; of the needle's
    // points every second millimetre is tried.
    const double seen = sight.visible_mm(down(0), {-30, 0, 40}, {30, 0, 40}, 0);
    EXPECT_NEAR(seen, 60 - 8 + 4, 2.1);
    EXPECT_LT(sight.contrast(down(0), {10, 0, 40}, {1, 0, 0}, kBevel, 20, 0),
              NeedleSight::kShownGrey);
    EXPECT_DOUBLE_EQ(sight.visible_mm(down(0), {-30, 0, 12}, {30, 0, 12}, 0), 60);
    EXPECT_EQ(sight.visible_mm(down(0), {-30, 4, 12}, {30, 4, 12}, 0), 0);  // beside the plane
}

// The part of a needle that the sector cannot show is not asked for: 60 mm of width, 20 mm of way
// to each side of it.
TEST(NeedleSight, OnlyTheSectorIsAskedFor) {
    const Rib rib;
    const NeedleSight sight(&rib, with_linear_probe());
    EXPECT_DOUBLE_EQ(sight.in_sector_mm({-50, 0, 12}, {50, 0, 12}), 60);
    EXPECT_DOUBLE_EQ(sight.in_sector_mm({-50, 4, 12}, {50, 4, 12}), 60);  // though not in the plane
    EXPECT_EQ(sight.in_sector_mm({-50, 0, 12}, {-40, 0, 12}), 0);
    EXPECT_TRUE(sight.on_the_way({-40, 0, 12}, {1, 0, 0}));
    EXPECT_FALSE(sight.on_the_way({-20, 0, 12}, {1, 0, 0}));  // there
    EXPECT_FALSE(sight.on_the_way({-40, 4, 12}, {1, 0, 0}));  // aimed past the plane
    EXPECT_FALSE(sight.on_the_way({40, 0, 12}, {1, 0, 0}));   // past it
}

// A thin plate of bone dims needle and tissue alike: the needle still shows.
class Plate final : public Anatomy {
  public:
    bool inside(Point3 p) const override { return p.z < 0; }
    int label(Point3 p) const override { return !inside(p) ? 0 : p.z < -20 && p.z > -22 ? 2 : 1; }
    double exit_distance(Point3 from, Vector3 d, double reach) const override {
        return d.z > 0 ? std::min(reach, -from.z / d.z) : reach;
    }
    bool knows_tissue() const override { return true; }
    bool blocks_sound(int label) const override { return label == 2; }
};

TEST(NeedleSight, AMirrorShowsInAWeakShadowAndAnObliqueShaftDoesNot) {
    const Plate plate;
    const NeedleSight sight(&plate, with_linear_probe());
    const auto shows = [&](Vector3 axis) {
        return sight.contrast(down(0), {0, 0, 40}, axis, kBevel, 20, 0) >= NeedleSight::kShownGrey;
    };
    EXPECT_TRUE(shows({1, 0, 0}));
    EXPECT_FALSE(shows(normalized({1, 0, 2})));
}

// The defect as it was found: a needle wholly behind a rib scored as wholly in the image.
TEST(Sight, ANeedleBehindARibScoresAsUnseen) {
    const Rib rib;
    Exercise exercise;
    exercise.probe = linear();
    Session session;
    for (int i = 0; i < 20; ++i) {
        SessionSample sample;
        sample.time_s = 0.1 * i;
        sample.probe_ok = sample.needle_ok = true;
        sample.mannequin_from_probe = down(0);
        // Straight down through the rib, from behind it on.
        sample.mannequin_from_drawn = sample.mannequin_from_needle = {
            Matrix3::from_columns({1, 0, 0}, {0, -1, 0}, {0, 0, -1}), {10, 0, -25.0 - i}};
        session.samples.push_back(sample);
    }
    const SessionScore score = score_session(session, exercise, &rib, {});
    EXPECT_EQ(score.value("tip_in_view_fraction"), 0);
    EXPECT_EQ(score.value("tip_in_view_at_advance_fraction"), 0);
    EXPECT_LT(score.value("needle_in_beam_fraction"), 0.75);  // what is before the rib
}

}  // namespace
}  // namespace sonocase
