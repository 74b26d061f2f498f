// SPDX-License-Identifier: Apache-2.0

// Scores of sessions written by hand, and hard cases.
#include <gtest/gtest.h>

#include "ball.h"
#include "formats/exercise/metric_table.h"
#include "formats/scoring/session_score.h"
#include "support/random.h"

namespace sonocase {
namespace {

using testing::Ball;

const std::vector<Label> kLabels{
    {"outside", "", 0, {}}, {"body", "", 1, {}}, {"vessel", "", 2, {}}};
const Ball kBody({0, 0, -1000}, 1000);  // skin near z = 0 about the origin

// The probe at the origin looking down, the needle in its plane coming from +x at 45 degrees.
SessionSample sample_at(double time_s, double depth_mm, double out_of_plane_mm = 0) {
    SessionSample s;
    s.time_s = time_s;
    s.probe_ok = s.needle_ok = true;
    s.mannequin_from_probe = {Matrix3::from_columns({1, 0, 0}, {0, -1, 0}, {0, 0, -1}), {0, 0, 0}};
    const Vector3 direction = normalized({-1, 0, -1});
    const Point3 entry{40, out_of_plane_mm, 0};
    s.mannequin_from_needle = testing::needle_at(entry + depth_mm * direction, direction);
    s.mannequin_from_drawn = s.mannequin_from_needle;
    return s;
}

Exercise exercise_with_target(Point3 centre) {
    Exercise e;
    e.name = "hand-made";
    e.probe.shape = ProbeShape::linear;
    e.probe.width_mm = 100;
    e.probe.depth_mm = 100;
    e.probe.elevation_mm = 3;
    Target t;
    t.name = "target";
    t.centre = centre;
    t.hit_radius_mm = 3;
    e.targets = {t};
    return e;
}

Session straight_insertion(double out_of_plane_mm = 0) {
    Session s;
    for (int i = 0; i <= 100; ++i)
        s.samples.push_back(sample_at(0.05 * i, 0.5 * i - 5, out_of_plane_mm));
    return s;
}

TEST(ScoreCases, AStraightInsertionInThePlane) {
    const Vector3 direction = normalized({-1, 0, -1});
    const Point3 target = Point3{40, 0, 0} + 45 * direction;
    Exercise e = exercise_with_target(target);
    e.pass_marks = {{"final_tip_to_target_mm", 2, -INFINITY},
                    {"needle_in_beam_fraction", INFINITY, 0.9},
                    {"elapsed_time_s", 1, -INFINITY},
                    {"probe_rotation_total_deg", 100, 1}};
    const SessionScore s = score_session(straight_insertion(), e, &kBody, kLabels);
    EXPECT_NEAR(s.value("elapsed_time_s"), 5, 1e-12);
    EXPECT_NEAR(s.value("needle_path_length_mm"), 50, 1e-9);
    EXPECT_NEAR(s.value("needle_path_inefficiency_percent"), 0, 1e-9);
    EXPECT_NEAR(s.value("depth_perception_mm"), 50, 1e-9);
    EXPECT_EQ(s.value("insertions"), 1);
    EXPECT_EQ(s.value("tissue_punctures"), 1);
    EXPECT_EQ(s.value("targets_hit"), 1);
    EXPECT_EQ(s.value("targets_scanned_percent"), 100);
    EXPECT_NEAR(s.value("final_tip_to_target_mm"), 0, 1e-9);
    EXPECT_NEAR(s.value("targeting_error_mm"), 0, 1e-9);
    EXPECT_NEAR(s.value("tissue_damage_mm2"), 0, 1e-9);
    EXPECT_NEAR(s.value("trajectory_deviation_mm"), 0, 1e-9);
    EXPECT_NEAR(s.value("final_angle_deg"), 0, 1e-6);
    // The ball is 0.8 mm lower at the entry than at the origin; the probe sees nothing above its
    // face.
    EXPECT_GT(s.value("needle_in_beam_fraction"), 0.97);
    EXPECT_EQ(s.value("tip_in_view_at_advance_fraction"), 1);
    EXPECT_NEAR(s.value("needle_plane_distance_max_mm"), 0, 1e-12);
    EXPECT_NEAR(s.value("needle_plane_angle_mean_deg"), 0, 1e-12);
    EXPECT_NEAR(s.value("probe_usage_time_s"), 5, 1e-12);
    ASSERT_EQ(s.pass_marks.size(), 4u);
    EXPECT_TRUE(s.pass_marks[0].passed);
    EXPECT_TRUE(s.pass_marks[1].passed);
    EXPECT_FALSE(s.pass_marks[2].passed);
    EXPECT_FALSE(s.pass_marks[3].passed);
    EXPECT_FALSE(s.passed);
    ASSERT_EQ(s.insertions.size(), 1u);
    EXPECT_TRUE(s.insertions[0].still_in);
    EXPECT_EQ(s.insertions[0].target, 0);
}

TEST(ScoreCases, BesideThePlaneTheNeedleIsNotInTheBeam) {
    const SessionScore s =
        score_session(straight_insertion(4), exercise_with_target({0, 0, -40}), &kBody, kLabels);
    EXPECT_EQ(s.value("needle_in_beam_fraction"), 0);
    EXPECT_EQ(s.value("tip_in_view_fraction"), 0);
    EXPECT_NEAR(s.value("needle_plane_distance_mean_mm"), 4, 1e-12);
}

// Behind a frozen picture the needle goes in as it does before a live one, and nothing is seen.
TEST(ScoreCases, BehindAFrozenPictureNothingIsSeen) {
    const Vector3 direction = normalized({-1, 0, -1});
    const Exercise e = exercise_with_target(Point3{40, 0, 0} + 45 * direction);
    Session s = straight_insertion();
    for (SessionSample& sample : s.samples) sample.unseen = true;
    const SessionScore all = score_session(s, e, &kBody, kLabels);
    EXPECT_EQ(all.value("insertions"), 1);
    EXPECT_EQ(all.value("targets_hit"), 1);
    EXPECT_NEAR(all.value("needle_path_length_mm"), 50, 1e-9);
    EXPECT_EQ(all.value("targets_scanned_percent"), 0);
    EXPECT_EQ(all.value("needle_in_beam_fraction"), 0);
    EXPECT_EQ(all.value("tip_in_view_fraction"), 0);
    EXPECT_EQ(all.value("tip_in_view_at_advance_fraction"), 0);
    // Seen for the second half of its way alone.
    for (std::size_t i = 56; i < s.samples.size(); ++i) s.samples[i].unseen = false;
    const SessionScore half = score_session(s, e, &kBody, kLabels);
    EXPECT_NEAR(half.value("tip_in_view_at_advance_fraction"), 0.5, 0.02);
    EXPECT_EQ(half.value("targets_scanned_percent"), 100);
}

TEST(ScoreCases, SweepingTheShaftSidewaysDamagesTissue) {
    Session s;
    for (int i = 0; i <= 100; ++i) {
        SessionSample sample = sample_at(0.05 * i, 0);
        sample.mannequin_from_drawn = testing::needle_at({0.1 * i, 0, -50}, {0, 0, -1});
        s.samples.push_back(sample);
    }
    const SessionScore score = score_session(s, exercise_with_target({0, 0, -50}), &kBody, kLabels);
    EXPECT_NEAR(score.value("tissue_damage_mm2"), 10 * 50,
                1);  // the skin is 0.05 mm lower at the end
}

TEST(ScoreCases, OneTargetOutsideTheImageDoesNotHideLaterOnes) {
    Exercise e = exercise_with_target({500, 500, 500});
    e.targets.push_back(e.targets[0]);
    e.targets[1].centre = {0, 0, -40};
    const SessionScore s = score_session(straight_insertion(), e, &kBody, kLabels);
    EXPECT_EQ(s.value("targets_scanned_percent"), 50);
    EXPECT_LT(s.targets[0].first_scanned_s, 0);
    EXPECT_EQ(s.targets[1].first_scanned_s, 0);
}

TEST(ScoreCases, NoGoStructuresAreCountedAlongTheWholeShaft) {
    const Ball body({0, 0, -1000}, 1000, Point3{40, 0, 0} + 20 * normalized({-1, 0, -1}), 3);
    Exercise e = exercise_with_target({0, 0, -40});
    e.no_go = {"vessel"};
    const SessionScore s = score_session(straight_insertion(), e, &body, kLabels);
    EXPECT_EQ(s.value("no_go_contacts"), 1);
    // From 17 mm deep to the end at 45: the tip is through, the shaft is not out of it.
    EXPECT_NEAR(s.value("no_go_time_s"), 28 / 10.0, 0.11);
    e.no_go = {"spleen"};
    const SessionScore none = score_session(straight_insertion(), e, &body, kLabels);
    EXPECT_TRUE(std::isnan(none.value("no_go_contacts")));
    EXPECT_FALSE(none.warnings.empty());
}

TEST(ScoreCases, HardCasesGiveNumbersOrNanAndNeverCrash) {
    const Exercise e = exercise_with_target({0, 0, -40});
    const auto score = [&](const Session& s) { return score_session(s, e, &kBody, kLabels); };
    EXPECT_TRUE(std::isnan(score({}).value("elapsed_time_s")));

    Session one;
    one.samples = {sample_at(3, 10)};
    EXPECT_EQ(score(one).value("elapsed_time_s"), 0);
    EXPECT_EQ(score(one).value("time_in_tissue_s"), 0);
    EXPECT_EQ(score(one).value("insertions"), 1);

    Session still;
    for (int i = 0; i < 50; ++i) still.samples.push_back(sample_at(0.1 * i, 30));
    EXPECT_EQ(score(still).value("needle_path_length_mm"), 0);
    EXPECT_NEAR(score(still).value("time_in_tissue_s"), 4.9, 1e-12);
    EXPECT_TRUE(std::isnan(score(still).value("tip_in_view_at_advance_fraction")));

    Session never_in;
    for (int i = 0; i < 50; ++i) never_in.samples.push_back(sample_at(0.1 * i, -30));
    EXPECT_EQ(score(never_in).value("insertions"), 0);
    EXPECT_EQ(score(never_in).value("time_in_tissue_s"), 0);
    EXPECT_TRUE(std::isnan(score(never_in).value("final_tip_to_target_mm")));
    EXPECT_TRUE(std::isnan(score(never_in).value("needle_in_beam_fraction")));

    Session gap = straight_insertion();
    for (std::size_t i = 60; i < gap.samples.size(); ++i) gap.samples[i].time_s += 5;
    EXPECT_NEAR(score(gap).value("tracking_gap_s"), 5.05, 1e-9);
    EXPECT_NEAR(score(gap).value("elapsed_time_s"), 10, 1e-9);
    EXPECT_EQ(score(gap).value("insertions"), 1);

    Session back = straight_insertion();
    back.samples[50].time_s = back.samples[49].time_s;  // repeats
    back.samples[70].time_s = 0;                        // runs back
    EXPECT_EQ(score(back).value("insertions"), 1);
    EXPECT_NEAR(score(back).value("needle_path_length_mm"), 50, 1e-9);
    EXPECT_FALSE(score(back).warnings.empty());

    Session bad = straight_insertion();
    bad.samples[20].mannequin_from_drawn.translation.x = NAN;
    bad.samples[21].mannequin_from_probe.rotation.m[4] = INFINITY;
    bad.samples[22].time_s = NAN;
    EXPECT_TRUE(std::isfinite(score(bad).value("needle_path_length_mm")));

    const SessionScore bodiless = score_session(straight_insertion(), e, nullptr, {});
    EXPECT_NEAR(bodiless.value("needle_path_length_mm"), 50, 1e-9);
    EXPECT_TRUE(std::isnan(bodiless.value("time_in_tissue_s")));
}

TEST(ScoreCases, ATipTremblingOnTheSkinIsContactAndNoInsertion) {
    testing::Random random(15);
    Session s;
    for (int i = 0; i < 600; ++i) s.samples.push_back(sample_at(i / 60.0, 0.3 * random.gaussian()));
    const SessionScore score = score_session(s, exercise_with_target({0, 0, -40}), &kBody, kLabels);
    EXPECT_EQ(score.value("insertions"), 0);
    EXPECT_EQ(score.value("skin_contacts"), 1);
    EXPECT_EQ(score.value("tissue_punctures"), 0);
}

// A cube of 100 mm under z = 0 as a mesh; its top face is cut along the diagonal x = y.
TEST(ScoreCases, EntryOnAnEdgeAndACornerOfTheMeshIsOneInsertion) {
    Surface cube;
    for (int i = 0; i < 8; ++i)
        cube.points.push_back({i & 1 ? 50.0 : -50.0, i & 2 ? 50.0 : -50.0, i & 4 ? 0.0 : -100.0});
    cube.triangles = {{0, 2, 1}, {1, 2, 3}, {4, 5, 7}, {4, 7, 6}, {0, 1, 4}, {1, 5, 4},
                      {2, 6, 3}, {3, 6, 7}, {0, 4, 2}, {2, 4, 6}, {1, 3, 5}, {3, 7, 5}};
    const MeshAnatomy body(std::move(cube));
    const Exercise e = exercise_with_target({0, 0, -40});
    for (const Point3 entry : {Point3{0, 0, 0}, Point3{20, 20, 0}, Point3{-50, -50, 0}}) {
        // Straight down the diagonal edge, or from the corner to the middle.
        const Vector3 direction = entry.x == -50 ? normalized({1, 1, -1}) : Vector3{0, 0, -1};
        Session s;
        for (int i = 0; i <= 60; ++i) {
            SessionSample sample = sample_at(0.05 * i, 0);
            sample.mannequin_from_drawn =
                testing::needle_at(entry + (0.5 * i - 10) * direction, direction);
            s.samples.push_back(sample);
        }
        const SessionScore score = score_session(s, e, &body, kLabels);
        EXPECT_EQ(score.value("insertions"), 1) << entry.x;
        EXPECT_NEAR(score.value("deepest_mm"), 20, 1e-9) << entry.x;
        EXPECT_EQ(score.value("tissue_punctures"), 1) << entry.x;
        EXPECT_TRUE(std::isfinite(score.value("tissue_damage_mm2"))) << entry.x;
    }
}

TEST(ScoreCases, TheBreathingThatCountsIsThatOfThePicture) {
    Exercise e;
    e.breathing.amplitude_mm = 7;
    const auto amplitude = [&](const std::string& render) {
        SessionHeader header;
        header.render = render;
        return breathing_shown(e, header).amplitude_mm;
    };
    EXPECT_EQ(amplitude("model=physical effects=auto size=512x512 seed=1"), 7);
    EXPECT_EQ(amplitude("model=physical effects=all"), 7);
    EXPECT_EQ(amplitude("model=physical effects=speckle,breathing"), 7);
    EXPECT_EQ(amplitude("model=physical effects=-speckle"), 7);
    EXPECT_EQ(amplitude("model=physical effects=auto,-breathing"), 0);
    EXPECT_EQ(amplitude("model=physical effects=speckle"), 0);
    EXPECT_EQ(amplitude("model=physical effects=none"), 0);
    EXPECT_EQ(amplitude("model=paper effects=auto"), 0);  // that model does not breathe
    EXPECT_EQ(amplitude(""), 0);                          // another trainer's recording
}

TEST(ScoreCases, TenThousandTargets) {
    testing::Random random(31);
    Exercise e = exercise_with_target({0, 0, 0});
    e.targets.assign(10000, e.targets[0]);
    for (Target& t : e.targets) t.centre = random.point(100);
    int slow = 0;
    const Session session = straight_insertion();
    for (const Target& t : e.targets) {
        bool hit = false;
        for (const SessionSample& s : session.samples) {
            const Vector3 p = s.mannequin_from_drawn.translation;
            hit = hit || distance({p.x, p.y, p.z}, t.centre) <= t.hit_radius_mm;
        }
        slow += hit;
    }
    EXPECT_EQ(score_session(session, e, &kBody, kLabels).value("targets_hit"), slow);
}

TEST(ScoreCases, EveryMetricOfTheTableIsListedOnceAndDocumented) {
    const SessionScore s =
        score_session(straight_insertion(), exercise_with_target({0, 0, -40}), &kBody, kLabels);
    ASSERT_EQ(s.metrics.size(), metric_table().size());
    for (std::size_t i = 0; i < s.metrics.size(); ++i)
        EXPECT_EQ(s.metrics[i].name, metric_table()[i].name);
    EXPECT_EQ(metric_unit("tissue_damage_mm2"), "mm\u00b2");
    EXPECT_EQ(metric_unit("elapsed_time_s"), "s");
    EXPECT_EQ(metric_unit("needle_motion_smoothness_mm_s3"), "mm/s\u00b3");
    EXPECT_EQ(metric_unit("targets_hit"), "");
}

}  // namespace
}  // namespace sonocase
