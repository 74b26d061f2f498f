// SPDX-License-Identifier: Apache-2.0

#include <gtest/gtest.h>

#include <algorithm>
#include <cstdio>

#include "formats/base/constants.h"
#include "formats/calibration/calibration.h"
#include "formats/calibration/image_plane.h"
#include "formats/calibration/lag.h"
#include "support/hard_case.h"
#include "support/random.h"
#include "support/read_recording.h"

namespace sonocase {
namespace {

using testing::Random;
using testing::read_recording;

double wander(double t) {
    return 10 * std::sin(2.1 * t) + 6 * std::sin(3.7 * t + 1) + 3 * std::sin(7.3 * t + 2);
}

Signal sampled(
    double rate, double lag, double noise, double gain, Random& random, double offset = 0) {
    Signal s;
    for (double t = 0.003 * rate / 60; t < 15; t += 1 / rate) {
        s.time_s.push_back(t + offset);
        s.value.push_back(gain * wander(t - lag) + noise * random.gaussian());
    }
    return s;
}

TEST(Lag, KnownLagAtUnlikeRatesIsFoundToTwoMilliseconds) {
    Random random(1);
    for (double lag : {-0.3, -0.041, 0.0, 0.0877, 0.25}) {
        for (double gain : {1.0, -0.2}) {
            const LagFit fit = fit_lag(sampled(60, 0, 0.1, 1, random),
                                       sampled(41, lag, 0.1 * std::abs(gain), gain, random));
            ASSERT_TRUE(fit.determined) << fit.problem;
            EXPECT_NEAR(fit.lag_s, lag, 0.002);
            EXPECT_EQ(fit.correlation > 0, gain > 0);
            EXPECT_LT(std::abs(fit.lag_s - lag), 4 * fit.sigma_s + 1e-3);
        }
    }
}

TEST(Lag, SwappingTheTwoNegatesTheLag) {
    Random random(2);
    const Signal a = sampled(60, 0, 0.05, 1, random), b = sampled(50, 0.12, 0.05, 1, random);
    EXPECT_NEAR(fit_lag(a, b).lag_s, -fit_lag(b, a).lag_s, 0.001);
}

TEST(Lag, RepeatedAndUnsortedTimesDoNoHarm) {
    Random random(3);
    const Signal a = sampled(60, 0, 0.05, 1, random);
    Signal b = sampled(60, 0.1, 0.05, 1, random);
    b.time_s[100] = b.time_s[99];
    std::swap(b.time_s[200], b.time_s[205]);
    std::swap(b.value[200], b.value[205]);
    b.value[300] = NAN;
    EXPECT_NEAR(fit_lag(a, b).lag_s, 0.1, 0.002);
}

TEST(Lag, TroubleHasItsOwnWords) {
    Random random(4);
    const Signal a = sampled(60, 0, 0.05, 1, random);
    Signal still = a, noise = a, wave = a, few;
    for (std::size_t i = 0; i < a.time_s.size(); ++i) {
        still.value[i] = 5;
        noise.value[i] = 0;
        for (int k = 0; k < 1; ++k) noise.value[i] += std::sin(0.9 * a.time_s[i] * a.time_s[i]);
        wave.value[i] = std::sin(2 * kPi * a.time_s[i] / 0.35);
    }
    few.time_s = {0, 1, 2};
    few.value = {0, 1, 0};
    EXPECT_NE(fit_lag(a, few).problem.find("readings"), std::string::npos);
    EXPECT_NE(fit_lag(a, still).problem.find("no motion"), std::string::npos);
    EXPECT_FALSE(fit_lag(a, noise).determined);
    int named = 0;
    for (int n = 0; n < 16; ++n) {  // periods from 0.2 to 0.5 s, the largest lag sought
        for (std::size_t i = 0; i < a.time_s.size(); ++i)
            wave.value[i] = std::sin(2 * kPi * a.time_s[i] / (0.2 + 0.02 * n));
        const LagFit even = fit_lag(wave, wave);
        named += !even.warnings.empty() && even.warnings[0].find("unevenly") != std::string::npos;
    }
    testing::HardCase even("of 16 even motions, named", testing::HardCase::at_least, 16, "");
    even.see(named);
    Signal later = a;
    for (double& t : later.time_s) t += 100;
    EXPECT_NE(fit_lag(a, later).problem.find("overlap"), std::string::npos);
}

TEST(Lag, ShiftedRecordingOfAHandIsFound) {
    const std::vector<Pose> poses =
        read_recording("probe_translation_watertank/probe_to_tracker.csv");
    if (poses.empty()) GTEST_SKIP() << "shared/data/tracking is absent";
    std::vector<Pose> late = poses;
    for (Pose& p : late) p.timestamp_s += 0.073;
    EXPECT_NEAR(fit_lag(position_signal(poses), position_signal(late)).lag_s, 0.073, 0.002);
    EXPECT_NEAR(fit_lag(speed_signal(poses), speed_signal(late)).lag_s, 0.073, 0.002);
}

TEST(ImagePlane, TouchesGiveMiddleAndWidth) {
    Random random(5);
    const Rigid sensor_from_probe = random.rigid(50);
    ImagePlaneInput in;
    in.sensor_from_probe = sensor_from_probe;
    in.mark_end = {sensor_from_probe * Point3{32, 0.5, 1}};
    in.other_end = {sensor_from_probe * Point3{-28, 0.5, 1}};
    in.in_front = {sensor_from_probe * Point3{0, 0, 40}};
    in.depth_mm = 150;
    in.height_px = 300;
    in.width_px = 401;
    const ImagePlane out = fit_image_plane(in);
    ASSERT_TRUE(out.determined);
    EXPECT_FALSE(out.mirrored);
    EXPECT_FALSE(out.upside_down);
    EXPECT_NEAR(out.footprint_mm, 60, 1e-9);
    EXPECT_LT(
        distance(out.sensor_from_probe * Point3{0, 0, 0}, sensor_from_probe * Point3{2, 0.5, 1}),
        1e-9);
    // The mark is on the left: a pixel left of the middle is towards it.
    EXPECT_GT(out.probe_from_pixel(100, 0).x, 0);
    EXPECT_NEAR(out.probe_from_pixel(200, 299).z, 299 * 0.5, 1e-9);
}

TEST(ImagePlane, MirroredAndUpsideDownAreFoundAndTurned) {
    Random random(6);
    const Rigid truth = random.rigid(50);
    for (const Vector3 wrong : {Vector3{-1, -1, 1}, {1, -1, -1}, {-1, 1, -1}}) {
        ImagePlaneInput in;
        in.mark_end = {truth * Point3{30, 0, 0}};
        in.other_end = {truth * Point3{-30, 0, 0}};
        in.in_front = {truth * Point3{5, 0, 60}};
        in.sensor_from_probe = {truth.rotation * Matrix3::diagonal(wrong), truth.translation};
        const ImagePlane out = fit_image_plane(in);
        EXPECT_EQ(out.mirrored, wrong.x < 0);
        EXPECT_EQ(out.upside_down, wrong.z < 0);
        EXPECT_FALSE(out.warnings.empty());
        EXPECT_LT(rotation_angle(transpose(truth.rotation) * out.sensor_from_probe.rotation), 1e-9);
        EXPECT_GT(determinant(out.sensor_from_probe.rotation), 0.99);
    }
}

TEST(ImagePlane, TroubleHasItsOwnWords) {
    ImagePlaneInput in;
    EXPECT_NE(fit_image_plane(in).problem.find("both ends"), std::string::npos);
    in.mark_end = {{1, 0, 0}};
    in.other_end = {{0, 0, 0}};
    EXPECT_NE(fit_image_plane(in).problem.find("apart"), std::string::npos);
    in.mark_end = {{5, 0, 50}};
    EXPECT_NE(fit_image_plane(in).problem.find("degrees to the lateral"), std::string::npos);
    in.mark_end = {{60, 0, 0}};
    in.footprint_mm = 40;
    EXPECT_NE(fit_image_plane(in).warnings[0].find("said to be"), std::string::npos);
}

TEST(Quality, OldPoorAndStrangeCalibrationsAreNamed) {
    Calibration good;
    good.kind = "probe";
    good.rms_mm = 0.5;
    good.sigma_mm = {0.1, 0.1, 0.1};
    good.condition = 5;
    good.poses = 100;
    good.date = "2026-11-20T10:00:00Z";
    const char* now = "2026-11-21T02:00:00Z";
    EXPECT_TRUE(calibration_concerns(good, now).empty());
    const auto concern = [&](auto change, const char* words) {
        Calibration c = good;
        change(c);
        const auto said = calibration_concerns(c, now);
        ASSERT_EQ(said.size(), 1u) << words;
        EXPECT_NE(said[0].find(words), std::string::npos) << said[0];
    };
    concern([](Calibration& c) { c.date = "2026-08-20"; }, "93 days old");
    concern([](Calibration& c) { c.date = "yesterday"; }, "no date");
    concern([](Calibration& c) { c.date = "2027-01-01"; }, "future");
    concern([](Calibration& c) { c.rms_mm = 3; }, "3.0 mm rms");
    concern([](Calibration& c) { c.rms_mm = -1; }, "does not say");
    concern([](Calibration& c) { c.sigma_mm.y = INFINITY; }, "only to inf");
    concern([](Calibration& c) { c.condition = 1e4; }, "hardly determines");
    concern([](Calibration& c) { c.poses = 5; }, "5 readings");
    concern([](Calibration& c) { c.sensor_from_tool.rotation(0, 0) = 2; },
            "not hold a proper rotation");
    concern([](Calibration& c) { c.scale = 0.001; }, "units");
}

TEST(Quality, DatesCountDays) {
    double a = 0, b = 0;
    ASSERT_TRUE(days_from_iso_date("1970-01-01", &a));
    EXPECT_EQ(a, 0);
    ASSERT_TRUE(days_from_iso_date("2024-02-28T12:00:00Z", &a));
    ASSERT_TRUE(days_from_iso_date("2024-03-01T12:00:00Z", &b));
    EXPECT_EQ(b - a, 2);  // a leap year
    EXPECT_FALSE(days_from_iso_date("", &a));
    EXPECT_FALSE(days_from_iso_date("2024-13-01", &a));
    EXPECT_FALSE(days_from_iso_date("20240301", &a));
}

}  // namespace
}  // namespace sonocase
