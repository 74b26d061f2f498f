// SPDX-License-Identifier: Apache-2.0

#include "runtime/player/session/frame_stats.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <limits>
#include <nlohmann/json.hpp>
#include <vector>

#include "support/random.h"

namespace sonocase::runtime {
namespace {

TEST(TimeHistogram, AgreesWithSortingWithinABin) {
    sonocase::testing::Random random(3);
    TimeHistogram histogram;
    std::vector<double> all;
    for (int i = 0; i < 5000; ++i) {
        const double ms = std::exp(random.uniform(-5, 6));
        all.push_back(ms);
        histogram.add(ms);
    }
    std::sort(all.begin(), all.end());
    for (double q : {0.01, 0.25, 0.5, 0.9, 0.99, 1.0}) {
        const double exact = all[static_cast<std::size_t>(std::max(0.0, std::ceil(q * 5000) - 1))];
        EXPECT_NEAR(histogram.quantile(q) / exact, 1, 0.011) << q;  // bins are 1 % wide
    }
}

TEST(TimeHistogram, SurvivesWhatIsNoTime) {
    TimeHistogram histogram;
    EXPECT_EQ(histogram.quantile(0.5), 0);
    histogram.add(std::numeric_limits<double>::quiet_NaN());
    EXPECT_EQ(histogram.count(), 0u);
    histogram.add(-1);
    histogram.add(0);
    histogram.add(1e12);
    EXPECT_EQ(histogram.count(), 3u);
    EXPECT_LE(histogram.quantile(0.5), 0.002);
}

TEST(FrameStats, CountsCostAndSkippedFramesPerEffect) {
    FrameStats stats;
    std::vector<EffectCost> costs(2);
    costs[0].name = "texture";
    costs[0].ms = 2;
    costs[0].ran = true;
    costs[1].name = "needle";
    for (int i = 0; i < 4; ++i) {
        costs[1].ran = i == 0;
        costs[1].ms = 1;
        costs[1].why = i == 0 ? "a needle" : "no needle near the plane";
        stats.add(5, costs);
    }
    const auto json = nlohmann::json::parse(stats.json(R"({"metrics": {"hits": 2}})", nullptr));
    EXPECT_EQ(json["frames"], 4);
    EXPECT_EQ(json["effects"][0]["name"], "texture");
    EXPECT_EQ(json["effects"][0]["ms"], 2);
    EXPECT_EQ(json["effects"][0]["skipped_frames"], 0);
    EXPECT_EQ(json["effects"][1]["ms"], 0.25);
    EXPECT_EQ(json["effects"][1]["skipped_frames"], 3);
    EXPECT_EQ(json["effects"][1]["cost"], "estimated");
    EXPECT_EQ(json["effects"][1]["why"],
              "on in 1 of 4 frames: a needle; in the others: no needle near the plane");
    EXPECT_EQ(json["metrics"]["hits"], 2);
}

TEST(FrameStats, NamesWhatTheGovernorDropped) {
    FrameStats stats;
    stats.add(5, {});
    stats.set_accuracy({0, 4, 192, 512, 192, 512});
    stats.add(5, {});
    stats.set_accuracy({2, 4, 128, 384, 192, 512});
    const auto accuracy = nlohmann::json::parse(stats.json("", nullptr))["accuracy"];
    EXPECT_EQ(accuracy["level"], 2);
    EXPECT_EQ(accuracy["dropped_beams"], 64);
    EXPECT_EQ(accuracy["dropped_samples"], 128);
    EXPECT_EQ(accuracy["reduced_frames"], 1);
    // Without a budget nothing can be dropped, and nothing is reported.
    FrameStats full;
    full.add(5, {});
    full.set_accuracy({0, 1, 192, 512, 192, 512});
    EXPECT_FALSE(nlohmann::json::parse(full.json("", nullptr)).contains("accuracy"));
}

}  // namespace
}  // namespace sonocase::runtime
