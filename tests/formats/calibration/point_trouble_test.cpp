// SPDX-License-Identifier: Apache-2.0

// Recordings that do not determine the tip, and rows that are not poses: each has its own words.
#include <gtest/gtest.h>

#include <algorithm>

#include "formats/base/constants.h"
#include "formats/calibration/point.h"
#include "support/calibration_motion.h"
#include "support/hard_case.h"

namespace sonocase {
namespace {

// Rotations written column by column, poses that map the tracker to the tool, a quaternion read in
// another order: the pivot fits badly, or its tip lies where no tool has one, and it is said why.
TEST(PointTrouble, PosesReadTheWrongWayAreNamed) {
    std::vector<Pose> poses;
    const Vector3 tip{5, -3, -120};
    for (int i = 0; i < 200; ++i) {
        const double t = 0.07 * i;
        const Matrix3 turn =
            rotation_about({std::cos(0.7 * t), std::sin(0.7 * t), 0}, 0.6 * std::sin(0.31 * t)) *
            rotation_about({0, 0, 1}, 0.9 * std::sin(0.2 * t));
        poses.push_back({i, t, true, Rigid{turn, Vector3{100, 50, -900} - turn * tip}});
    }
    const auto said = [&](auto change) {
        std::vector<Pose> changed = poses;
        for (Pose& pose : changed) pose.tracker_from_tool = change(pose.tracker_from_tool);
        return misread_poses(changed, fit_point(changed));
    };
    EXPECT_EQ(said([](const Rigid& p) { return p; }), "");
    EXPECT_NE(said([](const Rigid& p) {
                  return Rigid{transpose(p.rotation), p.translation};
              }).find("column by column"),
              std::string::npos);
    EXPECT_NE(said([](const Rigid& p) { return inverse(p); }).find("tracker to the tool"),
              std::string::npos);
    EXPECT_NE(said([](const Rigid& p) {
                  const Quaternion q = quaternion_from_rotation(p.rotation);
                  return Rigid{rotation_from_quaternion({q.x, q.y, q.z, q.w}), p.translation};
              }).find("qx,qy,qz,qw"),
              std::string::npos);
}

using testing::HardCase;
using testing::pivot_recording;
using testing::PivotMotion;
using testing::Random;

bool says(const PointFit& fit, const std::string& words) {
    if (fit.problem.find(words) != std::string::npos) return true;
    return std::any_of(fit.warnings.begin(), fit.warnings.end(),
                       [&](const std::string& w) { return w.find(words) != std::string::npos; });
}

Pose about_pivot(const PivotMotion& motion, const Matrix3& rotation) {
    Pose pose;
    pose.ok = true;
    const Point3 p = motion.pivot_mm - rotation * motion.tip_mm;
    pose.tracker_from_tool = {rotation, {p.x, p.y, p.z}};
    return pose;
}

TEST(PointTrouble, NearSingleAxisIsToldWithItsAxis) {
    Random random(8);
    const Vector3 axis = normalized({0.2, 0.9, -0.1});
    PivotMotion motion;
    std::vector<Pose> poses;
    for (int i = 0; i < 100; ++i) {
        // One axis of the sensor, plus a wobble of one degree.
        Pose pose = about_pivot(motion, rotation_about(random.direction(), 1 * kRadPerDeg) *
                                            rotation_about(axis, random.uniform(-0.6, 0.6)));
        for (int c = 0; c < 3; ++c)
            pose.tracker_from_tool.translation[c] += random.uniform(-0.3, 0.3);
        poses.push_back(pose);
    }
    const PointFit fit = fit_point(poses);
    EXPECT_TRUE(fit.determined);
    EXPECT_GT(std::abs(dot(fit.weak_axis, axis)), 0.99);
    EXPECT_GT(fit.weak_sigma_mm, 1);
    HardCase off("error along the weak axis over its sigma", HardCase::at_most, 4, "");
    off.see(std::abs(dot(fit.tip_mm - motion.tip_mm, axis)) / fit.weak_sigma_mm);
    EXPECT_TRUE(says(fit, "tilt it further"));
}

TEST(PointTrouble, SingleAxisIsUndeterminedAlongItAndSaysWhatToAdd) {
    HardCase across("tip across the one axis, noise of 0.3 mm", HardCase::at_most, 0.3, "mm");
    for (double noise_mm : {0.0, 0.3}) {
        Random random(9);
        const Vector3 axis = normalized({0, 1, 1});
        PivotMotion motion;
        std::vector<Pose> poses;
        for (int i = 0; i < 50; ++i) {
            Pose pose = about_pivot(motion, rotation_about(axis, random.uniform(-1, 1)));
            for (int c = 0; c < 3; ++c) {
                pose.tracker_from_tool.translation[c] += random.uniform(-noise_mm, noise_mm);
            }
            poses.push_back(pose);
        }
        const PointFit fit = fit_point(poses);
        EXPECT_FALSE(fit.determined);
        EXPECT_TRUE(says(fit, "about one axis"));
        EXPECT_TRUE(says(fit, "sideways"));
        EXPECT_GT(std::abs(dot(fit.weak_axis, axis)), 1 - 1e-9);
        EXPECT_TRUE(std::isinf(fit.condition));
        EXPECT_TRUE(std::isinf(fit.sigma_mm.y) && std::isinf(fit.sigma_mm.z));
        EXPECT_FALSE(std::isinf(fit.sigma_mm.x));
        // What is determined is right all the same.
        const double off = norm(cross(fit.tip_mm - motion.tip_mm, axis));
        EXPECT_LT(off, 1e-9 + noise_mm);
        across.see(off);
        EXPECT_NEAR(dot(fit.tip_mm, axis), 0, 1e-9);
    }
}

TEST(PointTrouble, StillSensorTooFewAndTwoPosesHaveTheirOwnWords) {
    Random random(10);
    PivotMotion motion;
    motion.noise_mm = 0.1;
    const std::vector<Pose> good = pivot_recording(motion, random);
    std::vector<Pose> still(80, good[0]);
    for (Pose& p : still) {
        p.tracker_from_tool.rotation =
            rotation_about(random.direction(), 0.0005) * p.tracker_from_tool.rotation;
    }
    const PointFit fit = fit_point(still);
    EXPECT_FALSE(fit.determined);
    EXPECT_TRUE(says(fit, "stood still"));
    EXPECT_TRUE(std::isinf(fit.sigma_mm.x));
    EXPECT_EQ(fit.tip_mm, (Vector3{0, 0, 0}));
    EXPECT_TRUE(says(fit_point(std::vector<Pose>(80, good[0])), "stood still"));

    EXPECT_TRUE(says(fit_point({}), "0 usable poses"));
    EXPECT_TRUE(says(fit_point(std::span(good).first(1)), "1 usable pose;"));
    EXPECT_TRUE(says(fit_point(std::span(good).first(2)), "2 usable poses leave"));
    for (std::size_t n = 3; n < 12; ++n) {
        const PointFit few = fit_point(std::span(good).first(n));
        EXPECT_TRUE(few.determined) << n;
        EXPECT_EQ(says(few, "take 30 or more"), n < 10) << n;
    }
}

TEST(PointTrouble, EveryKindOfBadRowIsNamedAndLeftOut) {
    HardCase tip("tip, twenty of a hundred rows spoilt in each of eight ways", HardCase::at_most,
                 0.1, "mm");
    HardCase numbers("tip, NaN, infinity, 1e308 mm or other units in twenty of a hundred rows",
                     HardCase::at_most, 0.1, "mm");
    Random random(11);
    PivotMotion motion;
    motion.noise_mm = 0.1;
    const std::vector<Pose> good = pivot_recording(motion, random);
    const auto check = [&](const char* words, auto spoil) {
        std::vector<Pose> poses = good;
        for (std::size_t i = 10; i < 30; ++i) spoil(poses[i]);
        const PointFit fit = fit_point(poses);
        EXPECT_TRUE(fit.determined) << words;
        EXPECT_TRUE(says(fit, words)) << words;
        EXPECT_EQ(fit.poses, 80) << words;
        const bool number =
            std::string(words) == "NaN" || std::string(words) == "units are mixed" || !*words;
        (number ? numbers : tip).see(norm(fit.tip_mm - motion.tip_mm));
    };
    check("status other than OK", [](Pose& p) { p.ok = false; });
    check("NaN", [](Pose& p) { p.tracker_from_tool.translation.y = NAN; });
    check("NaN", [](Pose& p) { p.tracker_from_tool.rotation(1, 2) = INFINITY; });
    check("not orthonormal", [](Pose& p) {
        for (double& v : p.tracker_from_tool.rotation.m) v *= 1.1;
    });
    check("mirrored", [](Pose& p) {
        for (std::size_t k = 0; k < 3; ++k) p.tracker_from_tool.rotation.m[k] *= -1;
    });
    // Whatever it is called.
    check("", [](Pose& p) { p.tracker_from_tool.translation.x = 1e308; });
    for (double f : {1e-3, 1e3, 1 / 25.4}) {
        check("units are mixed", [f](Pose& p) {
            p.tracker_from_tool.translation = f * p.tracker_from_tool.translation;
        });
    }
}

TEST(PointTrouble, TrackerAmidTheMotionIsNoMixOfUnits) {
    Random random(19);
    for (int draw = 0; draw < 20; ++draw) {
        PivotMotion motion;
        motion.poses = 200;
        motion.pivot_mm = random.point(120);
        const PointFit fit = fit_point(pivot_recording(motion, random));
        EXPECT_EQ(fit.poses, 200);
        EXPECT_TRUE(fit.warnings.empty());
    }
}

TEST(PointTrouble, RoundedRotationsAreStraightenedAndSaidSo) {
    Random random(12);
    PivotMotion motion;
    std::vector<Pose> poses = pivot_recording(motion, random);
    for (Pose& p : poses) {
        for (double& v : p.tracker_from_tool.rotation.m) v = std::round(v * 100) / 100;
    }
    const PointFit fit = fit_point(poses);
    EXPECT_TRUE(says(fit, "nearest rotation"));
    HardCase tip("tip, rotations rounded to two decimals", HardCase::at_most, 1, "mm");
    tip.see(norm(fit.tip_mm - motion.tip_mm));
}

TEST(PointTrouble, QuaternionSignFlips) {
    // A smooth recording; q and -q are one rotation, q and its conjugate are not.
    PivotMotion motion;
    std::vector<Pose> negated, conjugated;
    for (int i = 0; i < 300; ++i) {
        const double a = 0.02 * i;
        const Matrix3 r = rotation_about({1, 0, 0}, 0.5 * std::sin(a)) *
                          rotation_about({0, 1, 0}, 0.4 * std::sin(1.7 * a)) *
                          rotation_about({0, 0, 1}, 0.8);
        const Quaternion q = quaternion_from_rotation(r);
        Pose pose = about_pivot(motion, r);
        pose.frame = i;
        const bool flip = i % 50 > 40;
        if (flip)
            pose.tracker_from_tool.rotation = rotation_from_quaternion({-q.w, -q.x, -q.y, -q.z});
        negated.push_back(pose);
        if (flip)
            pose.tracker_from_tool.rotation = rotation_from_quaternion({q.w, -q.x, -q.y, -q.z});
        conjugated.push_back(pose);
    }
    HardCase tip("tip, signs of quaternions that flip", HardCase::at_most, 1e-9, "mm");
    tip.see(norm(fit_point(negated).tip_mm - motion.tip_mm));
    EXPECT_TRUE(fit_point(negated).warnings.empty());
    const PointFit fit = fit_point(conjugated);
    EXPECT_TRUE(says(fit, "quaternion sign"));
    tip.see(norm(fit.tip_mm - motion.tip_mm));
}

TEST(PointTrouble, WrongConventionsAreRecognised) {
    Random random(14);
    int named = 0, alarms = 0;
    for (int draw = 0; draw < 20; ++draw) {
        PivotMotion motion;
        motion.noise_mm = 0.2;
        const std::vector<Pose> poses = pivot_recording(motion, random);
        std::vector<Pose> transposed = poses, inverted = poses, metres = poses;
        for (std::size_t i = 0; i < poses.size(); ++i) {
            const Rigid& pose = poses[i].tracker_from_tool;
            transposed[i].tracker_from_tool.rotation = transpose(pose.rotation);
            inverted[i].tracker_from_tool = inverse(pose);
            metres[i].tracker_from_tool.translation = 1e-3 * pose.translation;
        }
        named += says(fit_point(transposed), "transposed");
        named += says(fit_point(inverted), "inverse poses");
        named += says(fit_point(metres), "metres");
        const PointFit right = fit_point(poses);
        for (const char* words : {"transposed", "inverse poses", "metres"})
            alarms += says(right, words);
    }
    HardCase wrong("of 60 recordings of another convention, named", HardCase::at_least, 60, "");
    wrong.see(named);
    HardCase alarm("of 20 right ones, called wrong", HardCase::at_most, 0, "");
    alarm.see(alarms);
}

}  // namespace
}  // namespace sonocase
