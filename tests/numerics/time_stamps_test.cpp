// SPDX-License-Identifier: Apache-2.0

// Time: pairing of recordings, and lags, with unusual clocks.
#include <gtest/gtest.h>

#include <cmath>

#include "formats/calibration/calibration.h"
#include "formats/calibration/lag.h"
#include "formats/calibration/pose_screen.h"
#include "numerics/property.h"
#include "support/hard_case.h"

namespace sonocase::numerics {
namespace {

using testing::HardCase;

double motion(double t) {
    return std::sin(2.3 * t) + 0.6 * std::sin(4.1 * t + 1) + 0.3 * std::sin(9.7 * t);
}

Signal sampled(double rate, double lag, double start, double jitter, testing::Random& random) {
    Signal s;
    for (double t = 0; t < 12; t += 1 / rate) {
        const double at = t + jitter / rate * random.uniform(-0.4, 0.4);
        s.time_s.push_back(start + at);
        s.value.push_back(motion(at - lag));
    }
    return s;
}

// Error of the lag over its bound: straight lines between samples of a motion of 10 rad/s, a
// twentieth of the slower step. NaN: no lag, or one that is hardly told.
double lag_over_bound(testing::Random random) {
    const double lag = random.uniform(-0.3, 0.3), first = random.uniform(25, 240),
                 second = random.uniform(25, 240);
    // Seconds since the start, since 1970 (where a double holds 0.24 us) and negative.
    const double start = random.uniform(0, 1) < 0.3 ? 1.8e9 : random.uniform(-100, 100);
    const LagFit fit =
        fit_lag(sampled(first, 0, start, 1, random), sampled(second, lag, start, 1, random));
    if (!fit.determined || fit.correlation <= 0.97) return NAN;
    return std::abs(fit.lag_s - lag) / (0.05 / std::min(first, second) + 2e-4);
}

RC_GTEST_PROP(TimeStampNumerics, LagIsFoundAtEveryRateJitterAndEpoch, ()) {
    RC_ASSERT(lag_over_bound(random_case()) < 1);
}

TEST(TimeStampNumerics, LagOfAHundredClocksOverItsBound) {
    HardCase lag("lag, off, over a twentieth of the slower step", HardCase::at_most, 1, "");
    for (std::uint64_t seed = 1; seed <= 100; ++seed)
        lag.see(lag_over_bound(testing::Random(seed)));
}

TEST(TimeStampNumerics, PairsAreTheNearestAndNoneIsTakenTwiceTheFrameAway) {
    std::vector<Pose> reference, tool;
    for (int i = 0; i < 50; ++i) {
        Pose p;
        p.ok = true;
        p.timestamp_s = 1.8e9 + 0.02 * i;
        p.tracker_from_tool.translation = {static_cast<double>(i), 0, 0};
        reference.push_back(p);
        p.timestamp_s += 0.004;
        p.tracker_from_tool.translation = {i + 0.25, 0, 0};
        tool.push_back(p);
    }
    tool.back().timestamp_s += 5;  // far from every reading
    tool[10].timestamp_s = NAN;
    const std::vector<Pose> pairs = relative_poses(reference, tool);
    EXPECT_EQ(pairs.size(), 48u);
    for (const Pose& p : pairs) EXPECT_DOUBLE_EQ(p.tracker_from_tool.translation.x, 0.25);
}

TEST(TimeStampNumerics, RepeatedBackwardAndSingleTimes) {
    std::vector<Pose> reference(1), tool(3);
    reference[0].ok = true;
    for (Pose& p : tool) p.ok = true;
    tool[2].timestamp_s = -1;
    EXPECT_EQ(relative_poses(reference, tool).size(),
              2u);  // half a second is the window of one reading
    EXPECT_TRUE(relative_poses({}, tool).empty());
    Signal s;
    for (int i = 0; i < 400; ++i) {
        s.time_s.push_back(i % 7 == 3 ? (i - 2) / 60.0 : i / 60.0);  // runs back and repeats
        s.value.push_back(motion(s.time_s.back()));
    }
    HardCase lag("lag of times that run back, off", HardCase::at_most, 1e-3, "s");
    lag.see(std::abs(fit_lag(s, s).lag_s));
}

}  // namespace
}  // namespace sonocase::numerics
