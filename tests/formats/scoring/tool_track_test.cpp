// SPDX-License-Identifier: Apache-2.0

#include "formats/scoring/tool_track.h"
#include "formats/base/constants.h"

#include <gtest/gtest.h>

#include "support/random.h"

namespace sonocase {
namespace {

std::vector<TrackPoint> random_track(std::uint64_t seed, int n) {
    testing::Random random(seed);
    std::vector<TrackPoint> points;
    double t = random.uniform(0, 100);
    Rigid pose = random.rigid(200);
    for (int i = 0; i < n; ++i) {
        points.push_back({t, pose, static_cast<std::size_t>(i)});
        t += random.uniform(0.005, 0.2);
        pose.translation = pose.translation + random.uniform(0, 12) * random.direction();
        pose.rotation = rotation_about(random.direction(), random.uniform(0, 0.3)) * pose.rotation;
    }
    return points;
}

using Triple = std::array<long double, 3>;
Triple at(const TrackPoint& p) {
    return {p.pose.translation.x, p.pose.translation.y, p.pose.translation.z};
}
long double length(const Triple& v) {
    return std::sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]);
}
Triple difference(const Triple& a, const Triple& b) {
    return {a[0] - b[0], a[1] - b[1], a[2] - b[2]};
}
Triple over(const Triple& a, long double s) {
    return {a[0] / s, a[1] / s, a[2] / s};
}

// Straight from docs/metrics.md, in long double, a pass over all readings for each measure.
struct Slow {
    long double path = 0, velocity = 0, jerk = 0, rotation = 0, box = 1, inefficiency = 0;
    int moves = 0, turns = 0;
};
Slow slow_metrics(const std::vector<TrackPoint>& p) {
    Slow s;
    const std::size_t n = p.size();
    std::vector<Triple> v(n), a(n);
    for (std::size_t i = 1; i < n; ++i) {
        const long double dt = static_cast<long double>(p[i].time_s) - p[i - 1].time_s;
        s.path += length(difference(at(p[i]), at(p[i - 1])));
        v[i] = over(difference(at(p[i]), at(p[i - 1])), dt);
        s.velocity += length(v[i]) / static_cast<long double>(n - 1);
        if (i >= 2) a[i] = over(difference(v[i], v[i - 1]), dt);
        if (i >= 3) {
            const long double j = length(over(difference(a[i], a[i - 1]), dt));
            s.jerk += j * j * dt;
        }
        // Angle by the trace, an independent formula; the steps here are far from 0 and pi.
        const Matrix3 r = p[i].pose.rotation * transpose(p[i - 1].pose.rotation);
        s.rotation +=
            std::acos(static_cast<long double>(r(0, 0) + r(1, 1) + r(2, 2) - 1) / 2) * 180 / kPi;
    }
    s.jerk = std::sqrt(s.jerk);
    for (std::size_t axis = 0; axis < 3; ++axis) {
        long double low = 1e30L, high = -1e30L;
        for (const TrackPoint& q : p) {
            low = std::min(low, at(q)[axis]);
            high = std::max(high, at(q)[axis]);
        }
        s.box *= high - low;
    }
    s.inefficiency = 100 * (s.path / length(difference(at(p.back()), at(p.front()))) - 1);
    const auto count = [&](auto rate) {
        int actions = 0;
        bool active = false;
        double agreed = p[0].time_s;
        for (std::size_t i = 1; i < n; ++i) {
            const bool fast = rate(i) > 50;
            if (fast != active && p[i].time_s - agreed <= 0.2) continue;
            if (fast && !active) ++actions;
            active = fast;
            agreed = p[i].time_s;
        }
        return actions;
    };
    s.moves = count([&](std::size_t i) { return static_cast<double>(length(v[i])); });
    s.turns = count([&](std::size_t i) {
        const Matrix3 r = p[i].pose.rotation * transpose(p[i - 1].pose.rotation);
        return std::acos((r(0, 0) + r(1, 1) + r(2, 2) - 1) / 2) * 180 / kPi /
               (p[i].time_s - p[i - 1].time_s);
    });
    return s;
}

TEST(ToolTrack, AgreesWithASlowComputationOnRandomTracks) {
    for (std::uint64_t seed = 1; seed <= 40; ++seed) {
        const auto points = random_track(seed, 300);
        const MotionMetrics m = motion_metrics(points);
        const Slow s = slow_metrics(points);
        const auto near = [&](double value, long double slow) {
            EXPECT_NEAR(value, static_cast<double>(slow),
                        1e-9 * std::abs(static_cast<double>(slow)))
                << seed;
        };
        near(m.path_length_mm, s.path);
        near(m.average_velocity_mm_s, s.velocity);
        near(m.motion_smoothness_mm_s3, s.jerk);
        near(m.path_inefficiency_percent, s.inefficiency);
        near(m.bounding_box_mm3, s.box);
        // acos of the trace has lost figures that the program's formula keeps.
        EXPECT_NEAR(m.rotation_total_deg, static_cast<double>(s.rotation),
                    1e-7 * m.rotation_total_deg);
        EXPECT_EQ(m.translational_actions, s.moves);
        EXPECT_EQ(m.rotational_actions, s.turns);
    }
}

TEST(ToolTrack, TurningAboutAFarPointIsMotionAndTurningInPlaceIsNot) {
    std::vector<TrackPoint> in_place;
    for (int i = 0; i < 200; ++i) {
        const Matrix3 r = rotation_about({0, 0, 1}, 0.05 * i);
        in_place.push_back({0.02 * i, {r, {500, 300, 100}}, 0});
    }
    const MotionMetrics m = motion_metrics(in_place);
    EXPECT_EQ(m.path_length_mm, 0);
    EXPECT_EQ(m.translational_actions, 0);  // although the frame's origin is 600 mm away
    EXPECT_EQ(m.rotational_actions, 1);
    EXPECT_NEAR(m.rotation_total_deg, 199 * 0.05 * 180 / kPi, 1e-9);
}

TEST(ToolTrack, RigidMotionOfEverythingChangesNoMeasureButTheBox) {
    testing::Random random(12);
    const auto points = random_track(5, 200);
    const Rigid moved_by = random.rigid(400);
    auto moved = points;
    for (TrackPoint& p : moved) p.pose = moved_by * p.pose;
    const MotionMetrics a = motion_metrics(points), b = motion_metrics(moved);
    EXPECT_NEAR(a.path_length_mm, b.path_length_mm, 1e-9 * a.path_length_mm);
    EXPECT_NEAR(a.motion_smoothness_mm_s3, b.motion_smoothness_mm_s3,
                1e-7 * a.motion_smoothness_mm_s3);
    EXPECT_NEAR(a.rotation_total_deg, b.rotation_total_deg, 1e-9 * a.rotation_total_deg);
    EXPECT_EQ(a.translational_actions, b.translational_actions);
    EXPECT_NEAR(a.filtered_path_length_mm, b.filtered_path_length_mm,
                1e-9 * a.filtered_path_length_mm);
}

// A smooth hand motion: a Lissajous figure with strokes of about a second.
Point3 hand(double t) {
    return {40 * std::sin(2 * kPi * 0.7 * t), 30 * std::sin(2 * kPi * 0.5 * t + 1),
            20 * std::cos(2 * kPi * 0.9 * t)};
}
double hand_path(double seconds) {
    double sum = 0;
    const int n = 200000;
    for (int i = 0; i < n; ++i) sum += distance(hand(seconds * i / n), hand(seconds * (i + 1) / n));
    return sum;
}

TEST(ToolTrack, PathAndTimeDoNotDependOnTheRateFrom10To1000Hz) {
    const double seconds = 30, truth = hand_path(seconds);
    for (const double rate : {10.0, 17.0, 30.0, 60.0, 120.0, 240.0, 1000.0}) {
        std::vector<TrackPoint> points;
        for (int i = 0; i <= seconds * rate; ++i)
            points.push_back({i / rate, {{}, hand(i / rate) - Point3{}}, 0});
        const MotionMetrics m = motion_metrics(points);
        EXPECT_NEAR(m.filtered_path_length_mm, truth, 0.01 * truth) << rate;
        EXPECT_NEAR(m.elapsed_time_s, seconds, 0.01 * seconds) << rate;
    }
}

TEST(ToolTrack, JitterOfATrackerDoesNotLengthenTheFilteredPath) {
    const double seconds = 30, truth = hand_path(seconds);
    for (const double rate : {60.0, 240.0, 1000.0}) {
        testing::Random random(9);
        std::vector<TrackPoint> points;
        for (int i = 0; i <= seconds * rate; ++i) {
            const Vector3 noise{random.gaussian(), random.gaussian(), random.gaussian()};
            points.push_back({i / rate, {{}, hand(i / rate) - Point3{} + 0.2 * noise}, 0});
        }
        const MotionMetrics m = motion_metrics(points);
        EXPECT_NEAR(m.filtered_path_length_mm, truth, 0.01 * truth) << rate;
        if (rate >= 240) {
            EXPECT_GT(m.path_length_mm, 1.1 * truth) << rate;  // what the filter is for
        }
    }
}

TEST(ToolTrack, HardCasesStayDefinedOrSayNan) {
    EXPECT_TRUE(std::isnan(motion_metrics({}).path_length_mm));
    const auto one = random_track(1, 1);
    EXPECT_EQ(motion_metrics(one).path_length_mm, 0);
    EXPECT_EQ(motion_metrics(one).elapsed_time_s, 0);
    EXPECT_TRUE(std::isnan(motion_metrics(one).average_velocity_mm_s));
    std::vector<TrackPoint> still(100);
    for (int i = 0; i < 100; ++i) still[static_cast<std::size_t>(i)].time_s = 0.1 * i;
    const MotionMetrics m = motion_metrics(still);
    EXPECT_EQ(m.path_length_mm, 0);
    EXPECT_EQ(m.filtered_path_length_mm, 0);
    EXPECT_EQ(m.motion_smoothness_mm_s3, 0);
    EXPECT_TRUE(std::isnan(m.path_inefficiency_percent));
    EXPECT_EQ(m.translational_actions, 0);
}

TEST(ToolTrack, RepeatedTimesCountForThePathAndNotForRates) {
    auto points = random_track(8, 50);
    auto doubled = points;
    doubled.insert(doubled.begin() + 20, points[19]);  // the same reading twice
    const MotionMetrics a = motion_metrics(points), b = motion_metrics(doubled);
    EXPECT_EQ(a.path_length_mm, b.path_length_mm);
    EXPECT_EQ(a.average_velocity_mm_s, b.average_velocity_mm_s);
    EXPECT_EQ(a.motion_smoothness_mm_s3, b.motion_smoothness_mm_s3);
    EXPECT_TRUE(std::isfinite(b.filtered_path_length_mm));
}

TEST(ToolTrack, TimesThatRunBackAndPosesThatAreNoneAreLeftOut) {
    Session s;
    for (const double t : {0.0, 1.0, 2.0, 1.5, 1.9, 3.0}) {
        SessionSample sample;
        sample.time_s = t;
        sample.needle_ok = t != 1.0;
        sample.mannequin_from_needle.translation.x = t;
        s.samples.push_back(sample);
    }
    s.samples.back().time_s = 8;
    const ToolTrack track = track_of(s, Tool::needle);
    EXPECT_EQ(track.points.size(), 3u);
    EXPECT_EQ(track.run_back, 2u);
    EXPECT_EQ(track.untracked, 1u);
    EXPECT_EQ(track.longest_gap_s, 6);
}

}  // namespace
}  // namespace sonocase
