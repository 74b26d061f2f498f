// SPDX-License-Identifier: Apache-2.0

// Poses of a camera of 30 Hz that come 45 ms late, with its noise, against where the tool is when
// they come; rendered pictures are MarkerPose's.

#include "formats/markers/pose_predictor.h"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <vector>

#include "formats/base/constants.h"
#include "formats/base/random.h"

namespace sonocase {
namespace {

constexpr double kPeriodS = 1 / 30.0, kLateS = 0.045;
constexpr double kAcrossMm = 0.12, kAlongMm = 0.5, kTurnRad = 0.002;
const Point3 kTool{0, 0, -120};

using Motion = std::function<Rigid(double)>;

double normal(RandomStream& random) {
    double sum = 0;
    for (int k = 0; k < 12; ++k) sum += random.unit();
    return sum - 6;
}

struct Came {
    double time_s;  // when it came
    Rigid raw, predicted;
};
std::vector<Came> watched(const Motion& truth, double seconds, std::uint64_t seed = 1) {
    RandomStream random(seed);
    PosePredictor predictor(kTool);
    std::vector<Came> out;
    for (int i = 0; i * kPeriodS < seconds; ++i) {
        const double t = i * kPeriodS;
        MarkerReading reading;
        reading.status = MarkerStatus::good;
        const Rigid is = truth(t);
        const Vector3 turn = kTurnRad * Vector3{normal(random), normal(random), normal(random)};
        const Point3 tool =
            is * kTool + Vector3{kAcrossMm * normal(random), kAcrossMm * normal(random),
                                 kAlongMm * normal(random)};
        Rigid& pose = reading.world_from_body;
        pose.rotation = rotation_about(normalized(turn), norm(turn)) * is.rotation;
        pose.translation = tool - pose.rotation * (kTool - Point3{}) - Point3{};
        reading.point_covariance = {kAcrossMm * kAcrossMm, 0, 0, 0, kAcrossMm * kAcrossMm, 0, 0, 0,
                                    kAlongMm * kAlongMm};
        for (int k = 0; k < 3; ++k) reading.turn_covariance[4 * k] = kTurnRad * kTurnRad;
        out.push_back({t + kLateS, pose, predictor.follow(reading, t, t + kLateS)});
    }
    return out;
}

struct Off {
    double rms_mm = 0, rms_deg = 0, worst_mm = 0, worst_deg = 0;
};
// Against the truth lag_s before each pose came; the first half second is left out.
Off off(const std::vector<Came>& poses, const Motion& truth, bool predicted, double lag_s) {
    Off o;
    int count = 0;
    for (const Came& c : poses) {
        if (c.time_s < 0.5) continue;
        const Rigid is = truth(c.time_s - lag_s), &seen = predicted ? c.predicted : c.raw;
        const double mm = distance(seen * kTool, is * kTool);
        const double deg = kDegPerRad * rotation_angle(transpose(is.rotation) * seen.rotation);
        o.rms_mm += mm * mm, o.rms_deg += deg * deg;
        o.worst_mm = std::max(o.worst_mm, mm), o.worst_deg = std::max(o.worst_deg, deg);
        ++count;
    }
    o.rms_mm = std::sqrt(o.rms_mm / count), o.rms_deg = std::sqrt(o.rms_deg / count);
    return o;
}
// The lag with which poses fit the truth best, of its tool's point.
double lag_of(const std::vector<Came>& poses, const Motion& truth, bool predicted) {
    double best_s = 0, least = 1e9;
    for (double lag_s = -0.03; lag_s < 0.08; lag_s += 0.001) {
        const double rms = off(poses, truth, predicted, lag_s).rms_mm;
        if (rms < least) least = rms, best_s = lag_s;
    }
    return best_s;
}

// To and fro, 100 mm/s and 0.8 rad/s at most.
Rigid to_and_fro(double t) {
    return {rotation_about(normalized({1, 0.3, 0}), 0.35 * std::sin(2.1 * t)) *
                rotation_about({0, 0, 1}, 0.3 * std::sin(1.3 * t)),
            {40 * std::sin(2.5 * t), 10 * std::cos(1.7 * t), 150}};
}
// Strokes of 100 mm/s that begin and end within a tenth of a second, with rests between them.
constexpr double kStrokesS = 2.4;
Rigid strokes(double t, double period_s) {
    const double phase = std::fmod(t, period_s);
    const auto ramp = [](double s) {  // the way after s seconds of a stroke of 1 s
        constexpr double kRise = 0.1, kSpeed = 100;
        s = std::clamp(s, 0.0, 1.0);
        const double rise = std::min(s, kRise), fall = std::max(0.0, s - (1 - kRise));
        return kSpeed * (s - kRise / 2 + (kRise - rise) * (kRise - rise) / (2 * kRise) -
                         fall * fall / (2 * kRise));
    };
    return {rotation_about({0, 1, 0}, 0.3), {ramp(phase - 0.1) - ramp(phase - 1.3), 0, 150}};
}

Rigid still(double) {
    return {rotation_about({1, 0, 0}, 0.4), {5, 6, 7}};
}

TEST(PosePredictor, AHandThatRestsIsStillerThanItsPoses) {
    const auto poses = watched(still, 40);
    const Off raw = off(poses, still, false, 0), predicted = off(poses, still, true, 0);
    EXPECT_LT(predicted.rms_mm, 0.9 * raw.rms_mm);
    EXPECT_LT(predicted.rms_deg, raw.rms_deg);
    EXPECT_LT(predicted.worst_mm, raw.worst_mm);
}

TEST(PosePredictor, AHandThatMovesIsShownWithoutLag) {
    for (const Motion& motion :
         {Motion(to_and_fro), Motion([](double t) { return strokes(t, kStrokesS); })}) {
        const auto poses = watched(motion, 30);
        // As they come they are late by what they took, which is 4.5 mm at 100 mm/s.
        EXPECT_NEAR(lag_of(poses, motion, false), kLateS, 0.002);
        const double lag_s = lag_of(poses, motion, true);
        EXPECT_NEAR(lag_s, 0, 0.004);
        const Off left = off(poses, motion, true, lag_s);
        EXPECT_LT(left.rms_mm, 1.2);
        EXPECT_LT(left.rms_deg, 0.5);
        // Where a stroke ends within a tenth of a second, it runs on for a picture.
        EXPECT_LT(left.worst_mm, 4);
        EXPECT_LT(left.worst_deg, 1.5);
    }
}

TEST(PosePredictor, NoPictureIsFarOffWhereverBetweenTwoAStrokeBeginsOrEnds) {
    for (int seed = 1; seed <= 12; ++seed) {
        const Off even = off(watched(to_and_fro, 30, seed), to_and_fro, true, 0);
        EXPECT_LT(even.rms_mm, 1) << seed;
        EXPECT_LT(even.worst_mm, 3) << seed;
        EXPECT_LT(even.worst_deg, 1) << seed;
        // Strokes begin and end elsewhere between two pictures each time. One that ends right after
        // a picture is not foreseen: 1 mm, half of 1000 mm/s2 times the square of 45 ms, to which
        // comes the noise, of which four standard deviations are 2 mm.
        const Motion motion = [&](double t) { return strokes(t, kStrokesS + 0.0137 * seed); };
        const Off hasty = off(watched(motion, 30, seed), motion, true, 0);
        EXPECT_LT(hasty.rms_mm, 1.05) << seed;
        EXPECT_LT(hasty.worst_mm, 3.4) << seed;
    }
}

TEST(PosePredictor, NoPredictionGoesFarAndGapsBeginAnew) {
    PosePredictor predictor(kTool);
    MarkerReading reading;
    reading.status = MarkerStatus::good;
    for (int k = 0; k < 3; ++k)
        reading.point_covariance[4 * k] = 0.01, reading.turn_covariance[4 * k] = 1e-6;
    // 2 m/s: it is thrown.
    Rigid at;
    for (int i = 0; i < 20; ++i) {
        reading.world_from_body.translation = {2000 * kPeriodS * i, 0, 0};
        at = predictor.follow(reading, i * kPeriodS, i * kPeriodS + kLateS);
    }
    const PredictorOptions options;
    const double ahead = at.translation.x - reading.world_from_body.translation.x;
    EXPECT_GT(ahead, 0.5 * options.max_mm);
    EXPECT_LT(ahead, options.max_mm + 1);
    // A second later it lies elsewhere: nothing of the old motion is left.
    reading.world_from_body.translation = {0, 50, 0};
    EXPECT_LT(norm(predictor.follow(reading, 2, 2 + kLateS).translation -
                   reading.world_from_body.translation),
              1e-9);
    // One of two poses is no motion.
    reading.two_poses = true;
    reading.world_from_body.translation = {0, 90, 0};
    EXPECT_EQ(predictor.follow(reading, 2 + kPeriodS, 2.1), reading.world_from_body);
}

}  // namespace
}  // namespace sonocase
