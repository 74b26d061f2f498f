// SPDX-License-Identifier: Apache-2.0

#include "runtime/engine/sensor_watch.h"

#include <gtest/gtest.h>

namespace sonocase::runtime {
namespace {

SensorReading at(double x) {
    SensorReading reading;
    reading.state = SensorState::ok;
    reading.world_from_sensor.translation = {x, 0, 0};
    return reading;
}

TEST(SensorWatch, IsContentWithANoisyMovingSensor) {
    SensorWatch watch;
    for (int i = 0; i < 500; ++i) {
        const double t = i / 240.0;
        watch.observe(at(300 * t + 0.02 * (i % 3)), t, true);
        EXPECT_EQ(watch.verdict(t), SensorVerdict::fine) << i;
        EXPECT_FALSE(watch.hold());
    }
}

TEST(SensorWatch, NoticesAFrozenSensorOfADeviceOnly) {
    SensorWatch device, script;
    for (int i = 0; i < 240; ++i) {
        device.observe(at(7), i / 240.0, true);
        script.observe(at(7), i / 240.0, false);
    }
    EXPECT_EQ(device.verdict(1), SensorVerdict::frozen);
    EXPECT_EQ(script.verdict(1), SensorVerdict::fine);
    device.observe(at(7.001), 1, true);
    EXPECT_EQ(device.verdict(1), SensorVerdict::fine);
}

TEST(SensorWatch, HoldsBackASingleWildReading) {
    SensorWatch watch;
    for (int i = 0; i < 10; ++i) watch.observe(at(0.01 * i), i / 240.0, true);
    watch.observe(at(400), 10 / 240.0, true);
    EXPECT_TRUE(watch.hold());
    EXPECT_EQ(watch.verdict(10 / 240.0), SensorVerdict::jumped);
    watch.observe(at(0.11), 11 / 240.0, true);
    EXPECT_FALSE(watch.hold());
    EXPECT_EQ(watch.jumps(), 1);
}

TEST(SensorWatch, BelievesANewPlaceThatIsConfirmed) {
    SensorWatch watch;
    for (int i = 0; i < 10; ++i) watch.observe(at(0.01 * i), i / 240.0, true);
    watch.observe(at(400), 10 / 240.0, true);
    watch.observe(at(400.2), 11 / 240.0, true);
    EXPECT_FALSE(watch.hold());
    EXPECT_EQ(watch.verdict(2), SensorVerdict::stale);  // and nothing more came
}

// NDI's number for a tool that is missing comes again and again, and confirms nothing.
TEST(SensorWatch, ANumberThatNoTrackerMeasuresIsLost) {
    for (const double missing : {-3.697314e28, 1e10, -1e6}) {
        SensorWatch watch;
        for (int i = 0; i < 10; ++i) watch.observe(at(0.01 * i), i / 60.0, true);
        for (int i = 10; i < 20; ++i) {
            watch.observe(at(missing), i / 60.0, true);
            EXPECT_TRUE(watch.lost(i / 60.0)) << missing;
            EXPECT_EQ(watch.verdict(i / 60.0), SensorVerdict::lost);
        }
        watch.observe(at(0.2), 20 / 60.0, true);
        EXPECT_FALSE(watch.lost(20 / 60.0) || watch.hold());
        EXPECT_EQ(watch.jumps(), 0);
    }
}

// Of a tool that it has lost, a sender gives the same default pose again and again.
TEST(SensorWatch, ADefaultPoseThatIsRepeatedConfirmsNothing) {
    SensorWatch watch;
    const auto noisy = [](int i) { return at(10 + 0.01 * (i % 7)); };
    int i = 0;
    for (; i < 60; ++i) watch.observe(noisy(i), i / 60.0, true, true);
    for (; i < 120; ++i) {
        watch.observe(at(400), i / 60.0, true, true);
        EXPECT_TRUE(watch.hold() || watch.lost(i / 60.0)) << i;
    }
    EXPECT_EQ(watch.verdict(i / 60.0), SensorVerdict::lost);
    // Nothing of it is shown when the tool is seen again.
    watch.observe(noisy(i), i / 60.0, true, true);
    EXPECT_FALSE(watch.hold() || watch.lost(i / 60.0));
    // Where nothing else moves, half a second of equal readings is a place.
    for (++i; i < 200; ++i) watch.observe(at(400), i / 60.0, true, false);
    EXPECT_FALSE(watch.hold());
}

TEST(SensorWatch, TellsLostFromStale) {
    SensorWatch watch;
    EXPECT_EQ(watch.verdict(0), SensorVerdict::absent);
    SensorReading lost = at(0);
    lost.state = SensorState::lost;
    watch.observe(lost, 0, true);
    EXPECT_EQ(watch.verdict(0.1), SensorVerdict::lost);
    EXPECT_EQ(watch.verdict(1), SensorVerdict::stale);
    // The first pose after a start without one is not a jump.
    watch.observe(at(500), 1.1, true);
    EXPECT_EQ(watch.verdict(1.1), SensorVerdict::fine);
}

}  // namespace
}  // namespace sonocase::runtime
