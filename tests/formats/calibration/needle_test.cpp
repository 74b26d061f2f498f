// SPDX-License-Identifier: Apache-2.0

#include "formats/calibration/needle.h"
#include "formats/base/constants.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstdio>

#include "support/calibration_motion.h"
#include "support/hard_case.h"

namespace sonocase {
namespace {

using testing::HardCase;

using testing::pivot_recording;
using testing::PivotMotion;
using testing::Random;

double angle(Vector3 a, Vector3 b) {
    return std::atan2(norm(cross(a, b)), dot(a, b));
}

struct Truth {
    Vector3 direction = normalized({0.1, -0.2, 0.97});
    Vector3 tip{14, -8, 160};
    std::vector<double> depths{0, 20, 40, 60, 80};
};

std::vector<std::vector<Pose>> pinholes(const Truth& truth,
                                        double noise_mm,
                                        Random& random,
                                        double tilt_deg = 30) {
    std::vector<std::vector<Pose>> out;
    for (double depth : truth.depths) {
        PivotMotion motion;
        motion.tip_mm = truth.tip - depth * truth.direction;
        motion.noise_mm = noise_mm;
        motion.tilt_rad = tilt_deg * kRadPerDeg;
        motion.poses = 60;
        out.push_back(pivot_recording(motion, random));
    }
    return out;
}

std::vector<Pose> spin(const Truth& truth, double noise_mm, double wobble_rad, Random& random) {
    std::vector<Pose> out;
    const Rigid groove = random.rigid(300);
    for (int i = 0; i < 120; ++i) {
        Pose p;
        p.ok = true;
        // tracker_from_needle turns about the needle's own axis; the tip stays.
        const Matrix3 r = groove.rotation * rotation_about(truth.direction, 0.1 * i) *
                          rotation_about(random.direction(), wobble_rad);
        p.tracker_from_tool.rotation = r;
        p.tracker_from_tool.translation = groove.translation - r * truth.tip;
        for (int c = 0; c < 3; ++c) {
            p.tracker_from_tool.translation[c] += random.uniform(-noise_mm, noise_mm);
        }
        out.push_back(p);
    }
    return out;
}

TEST(Needle, ExactPinholesGiveDirectionAndTip) {
    Random random(1);
    Truth truth;
    const auto recordings = pinholes(truth, 0, random);
    const NeedleFit fit = fit_needle(recordings, {.depths_mm = truth.depths});
    ASSERT_TRUE(fit.determined);
    EXPECT_LT(angle(fit.direction, truth.direction), 1e-9);
    EXPECT_LT(angle(fit.paper_direction, truth.direction), 1e-9);
    EXPECT_LT(norm(fit.tip_mm - truth.tip), 1e-7);
    EXPECT_TRUE(fit.tip_measured);
    // Depths that agree with the motion leave nothing to doubt, and nothing to say.
    EXPECT_LT(norm(fit.tip_sigma_mm), 1e-3);
    EXPECT_TRUE(fit.warnings.empty());
    EXPECT_LT(norm(fit.paper_point_mm - fit.axis_point_mm), 1e-7);
    // The frame: origin at the tip, z along the needle.
    const Rigid frame = fit.sensor_from_needle();
    EXPECT_LT(orthonormality_error(frame.rotation), 1e-14);
    EXPECT_LT(distance(frame * Point3{0, 0, 0}, {truth.tip.x, truth.tip.y, truth.tip.z}), 1e-7);
    EXPECT_LT(angle(frame * Vector3{0, 0, 1}, truth.direction), 1e-9);
}

TEST(Needle, HalfAMillimetreOfNoiseLeavesATenthOfADegree) {
    Random random(2);
    Truth truth;
    std::vector<double> errors, paper;
    int inside = 0;
    for (int draw = 0; draw < 100; ++draw) {
        const NeedleFit fit = fit_needle(pinholes(truth, 0.5, random), {.depths_mm = truth.depths});
        ASSERT_TRUE(fit.determined);
        errors.push_back(angle(fit.direction, truth.direction) / kRadPerDeg);
        paper.push_back(angle(fit.paper_direction, truth.direction) / kRadPerDeg);
        const Vector3 side = any_perpendicular(truth.direction);
        inside += std::abs(dot(fit.direction, side)) <= fit.direction_sigma_rad;
    }
    std::sort(errors.begin(), errors.end());
    std::sort(paper.begin(), paper.end());
    std::printf("direction error: median %.4f, 95 %% %.4f degrees; paper's %.4f, %.4f\n",
                errors[50], errors[95], paper[50], paper[95]);
    EXPECT_LT(errors[95], 0.1);
    EXPECT_GT(inside, 55);
    EXPECT_LT(inside, 82);
}

TEST(Needle, PoorDepthsCountForLess) {
    HardCase ratio("error of the direction, over that of the paper's", HardCase::at_most, 0.8, "");
    // One depth with little tilt: its point is far off, and weighing saves the direction.
    Random random(3);
    Truth truth;
    double weighed = 0, paper = 0;
    for (int draw = 0; draw < 40; ++draw) {
        auto recordings = pinholes(truth, 0.5, random);
        recordings[4] = pinholes(truth, 0.5, random, 2)[4];
        const NeedleFit fit = fit_needle(recordings, {.depths_mm = truth.depths});
        weighed += angle(fit.direction, truth.direction);
        paper += angle(fit.paper_direction, truth.direction);
    }
    ratio.see(weighed / paper);
}

TEST(Needle, DepthsGivenTheOtherWayRoundTurnTheDirection) {
    Random random(4);
    Truth truth;
    truth.tip = {0, 0, -10};  // the shaft passes the sensor: the sign must come from the depths
    truth.direction = {0, 0, 1};
    const NeedleFit fit = fit_needle(pinholes(truth, 0.1, random), {.depths_mm = truth.depths});
    EXPECT_LT(angle(fit.direction, truth.direction), 0.5 * kRadPerDeg);
    EXPECT_LT(norm(fit.tip_mm - truth.tip), 0.5);
}

TEST(Needle, WithoutDepthsTheFarthestPointIsTheTipAndItSaysSo) {
    Random random(5);
    Truth truth;
    const NeedleFit fit = fit_needle(pinholes(truth, 0.1, random));
    EXPECT_TRUE(fit.determined);
    EXPECT_FALSE(fit.tip_measured);
    EXPECT_LT(norm(fit.tip_mm - truth.tip), 0.2);
    EXPECT_NE(fit.warnings.back().find("No depths"), std::string::npos);
}

TEST(Needle, SpinAgreesWithPinholesOrSaysSo) {
    Random random(6);
    Truth truth;
    const NeedleFit holes = fit_needle(pinholes(truth, 0.2, random), {.depths_mm = truth.depths});
    const NeedleFit turned = fit_needle_spin(spin(truth, 0.2, 0.002, random));
    ASSERT_TRUE(turned.determined) << turned.problem;
    const NeedleAgreement same = compare(holes, turned);
    EXPECT_TRUE(same.agree) << same.sentence;
    EXPECT_LT(same.angle_rad, 0.2 * kRadPerDeg);
    Truth bent = truth;
    bent.direction = normalized(truth.direction + Vector3{0.05, 0, 0});
    const NeedleAgreement other = compare(holes, fit_needle_spin(spin(bent, 0.2, 0.002, random)));
    EXPECT_FALSE(other.agree);
    EXPECT_NEAR(other.angle_rad / kRadPerDeg, 2.8, 0.4);
    EXPECT_NE(other.sentence.find("disagree"), std::string::npos);
}

TEST(Needle, OnePivotAndOneSpinGiveTipAndDirection) {
    Random random(8);
    Truth truth;
    truth.tip = {5, -3, -120};
    truth.direction = {0, 0, -1};
    Truth tip_alone = truth;
    tip_alone.depths = {0};
    const PointFit pivot = fit_point(pinholes(tip_alone, 0.1, random)[0]);
    for (const double sign : {1.0, -1.0}) {  // a spin does not know which way it points
        Truth turned = truth;
        turned.direction = sign * truth.direction;
        const NeedleFit fit =
            join_pivot_and_spin(pivot, fit_needle_spin(spin(turned, 0.05, 0, random)));
        ASSERT_TRUE(fit.determined) << fit.problem;
        EXPECT_LT(norm(fit.tip_mm - truth.tip), 0.2);
        EXPECT_LT(angle(fit.direction, truth.direction), 0.2 * kRadPerDeg);
        EXPECT_TRUE(fit.tip_measured);
        EXPECT_LT(std::max({fit.tip_sigma_mm.x, fit.tip_sigma_mm.y, fit.tip_sigma_mm.z}), 0.2);
        for (const std::string& warning : fit.warnings)
            EXPECT_EQ(warning.find("neither the tip"), std::string::npos) << warning;
    }
    // Bent: the tip lies 6 mm beside the spun axis.
    Truth bent = truth;
    bent.tip = truth.tip + Vector3{6, 0, 0};
    const NeedleFit off = join_pivot_and_spin(pivot, fit_needle_spin(spin(bent, 0.05, 0, random)));
    EXPECT_TRUE(std::any_of(off.warnings.begin(), off.warnings.end(), [](const std::string& w) {
        return w.find("6.0 mm beside the axis") != std::string::npos;
    }));
    // Neither without the other.
    EXPECT_NE(join_pivot_and_spin(fit_point({}), fit_needle_spin(spin(truth, 0.05, 0, random)))
                  .problem.find("the pivot has no answer"),
              std::string::npos);
    EXPECT_NE(join_pivot_and_spin(pivot, fit_needle_spin({})).problem.find("the spin has no"),
              std::string::npos);
    // Across the axis from the sensor: the sign is not known.
    Truth across = truth;
    across.direction = {0, 1, 0};
    EXPECT_NE(join_pivot_and_spin(pivot, fit_needle_spin(spin(across, 0.05, 0, random)))
                  .problem.find("its sign is not known"),
              std::string::npos);
}

TEST(Needle, TroubleHasItsOwnWords) {
    HardCase answered("of six recordings without a direction, answered", HardCase::at_most, 0, "");
    int answers = 0;
    const auto refused = [&](const NeedleFit& fit, const char* words) {
        answers += fit.determined;
        EXPECT_NE(fit.problem.find(words), std::string::npos) << fit.problem;
    };
    Random random(7);
    Truth truth;
    refused(fit_needle({}), "0 usable pinhole depths");
    Truth one = truth;
    one.depths = {10};
    refused(fit_needle(pinholes(one, 0.1, random)), "1 usable pinhole depth;");
    Truth same = truth;
    same.depths = {10, 10.5, 11};
    refused(fit_needle(pinholes(same, 0.1, random)), "differ by");
    const auto recordings = pinholes(truth, 0.1, random);
    const std::vector<double> two{0, 10};
    refused(fit_needle(recordings, {.depths_mm = two}), "2 depths for 5");
    // Depths in centimetres.
    NeedleOptions centimetres;
    for (double d : truth.depths) centimetres.depths_mm.push_back(d / 10);
    const NeedleFit fit = fit_needle(recordings, centimetres);
    EXPECT_TRUE(std::any_of(fit.warnings.begin(), fit.warnings.end(), [](const std::string& w) {
        return w.find("give them in mm") != std::string::npos;
    }));
    refused(fit_needle_spin(std::vector<Pose>(50, recordings[0][0])), "spun by");
    refused(fit_needle_spin(recordings[0]), "tilted while");
    answered.see(answers);
}

}  // namespace
}  // namespace sonocase
