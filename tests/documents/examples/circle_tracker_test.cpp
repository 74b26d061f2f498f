// SPDX-License-Identifier: Apache-2.0

// The worked tracker of docs/extending.md.
#include "documents/examples/circle_tracker.h"

#include <gtest/gtest.h>

namespace sonocase::runtime {
namespace {

TEST(CircleTracker, StaysAtItsRadiusInThePlaneOfTheSkinAndComesBack) {
    Rigid start;
    start.translation = {10, 20, 30};
    CircleTracker tracker(start, 15);
    TrackerReading reading;
    for (int i = 0; i <= 8; ++i) {
        ASSERT_TRUE(tracker.poll(i, reading));
        const Vector3 t = reading.sensors[kProbeSensor].world_from_sensor.translation;
        // Rounding alone: a few units in the last place of 45 mm.
        EXPECT_NEAR(std::hypot(t.x - 10, t.y - 35), 15, 1e-12);
        EXPECT_EQ(t.z, 30);
    }
    // The angle is a full turn to the last digits of the constant.
    EXPECT_NEAR(reading.sensors[kProbeSensor].world_from_sensor.translation.y, 20, 1e-9);
    EXPECT_EQ(tracker.health().readings, 9u);
}

}  // namespace
}  // namespace sonocase::runtime
