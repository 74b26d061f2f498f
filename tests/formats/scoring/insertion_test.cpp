// SPDX-License-Identifier: Apache-2.0

#include "formats/scoring/insertion_detector.h"

#include <gtest/gtest.h>

#include "support/random.h"

namespace sonocase {
namespace {

const Vector3 kDown{0, 0, -1};

TEST(InsertionDetector, ATipThatTremblesOnTheSkinStartsNothing) {
    testing::Random random(3);
    InsertionDetector d;
    for (int i = 0; i < 10000; ++i) {
        EXPECT_EQ(d.update(i * 0.01, random.gaussian() * 0.4, kDown, {}), InsertionChange::none);
    }
    EXPECT_EQ(d.insertions(), 0);
}

TEST(InsertionDetector, EntryIsDatedBackToTheSkinAndKeepsTheDirectionHeldThere) {
    InsertionDetector d;
    for (int i = 0; i <= 100; ++i) {
        const double depth = -5 + 0.1 * i;
        const Vector3 held = normalized({0.01 * i, 0, -1});
        const InsertionChange change = d.update(0.1 * i, depth, held, {double(i), 0, 0});
        EXPECT_EQ(change == InsertionChange::entered, i == 70) << i;  // 2 mm deep
    }
    EXPECT_DOUBLE_EQ(d.entry_time_s(), 5.1);  // the first reading under the skin
    EXPECT_EQ(d.entry_direction(), normalized({0.51, 0, -1}));
    EXPECT_EQ(d.entry_point().x, 51);
    EXPECT_NEAR(d.deepest_mm(), 5, 1e-12);
}

TEST(InsertionDetector, JitterAtAnyDepthOrRateGivesOneInsertion) {
    for (const double rate : {10.0, 60.0, 1000.0}) {
        for (const double jitter : {0.0, 0.1, 0.3}) {
            testing::Random random(17);
            InsertionDetector d;
            int entered = 0, left = 0;
            // Down 30 mm in 6 s, rest, out in 6 s.
            for (int i = 0; i < 20 * rate; ++i) {
                const double t = i / rate;
                const double way = t < 7 ? 5 * t - 5 : t < 12 ? 30 : 30 - 5 * (t - 12);
                switch (d.update(t, way + jitter * random.gaussian(), kDown, {})) {
                    case InsertionChange::entered: ++entered; break;
                    case InsertionChange::left: ++left; break;
                    default: break;
                }
            }
            EXPECT_EQ(entered, 1) << rate << " Hz " << jitter;
            EXPECT_EQ(left, 1) << rate << " Hz " << jitter;
            EXPECT_NEAR(d.entry_time_s(), 1, 0.25 + 1 / rate);
            EXPECT_NEAR(d.exit_time_s(), 18, 0.25 + 1 / rate);
        }
    }
}

TEST(InsertionDetector, SeveralInsertionsAndAShortVisitAtTheSkin) {
    InsertionDetector d;
    double t = 0;
    const auto hold = [&](double depth, double seconds) {
        int changes = 0;
        for (const double end = t + seconds; t < end; t += 0.02) {
            if (d.update(t, depth, kDown, {}) != InsertionChange::none) ++changes;
        }
        return changes;
    };
    EXPECT_EQ(hold(-20, 1), 0);
    EXPECT_EQ(hold(30, 1), 1);
    EXPECT_EQ(hold(-0.5, 0.1), 0);  // drawn back to the skin and pushed on: the same insertion
    EXPECT_EQ(hold(40, 1), 0);
    EXPECT_EQ(hold(-0.5, 1), 1);
    EXPECT_EQ(hold(25, 1), 1);
    EXPECT_EQ(hold(-20, 0.02), 1);  // far out at once
    EXPECT_EQ(d.insertions(), 2);
    EXPECT_FALSE(d.inserted());
    EXPECT_EQ(d.deepest_mm(), 25);
}

TEST(InsertionDetector, AGapInTrackingChangesNothingWhenTheNeedleIsStillIn) {
    InsertionDetector d;
    d.update(0, -1, kDown, {});
    EXPECT_EQ(d.update(0.1, 5, kDown, {}), InsertionChange::entered);
    EXPECT_EQ(d.update(5.1, 7, kDown, {}), InsertionChange::none);
    EXPECT_EQ(d.update(10.2, -8, kDown, {}), InsertionChange::left);
    EXPECT_EQ(d.exit_time_s(), 10.2);
}

}  // namespace
}  // namespace sonocase
