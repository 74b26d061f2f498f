// SPDX-License-Identifier: Apache-2.0

#include "runtime/player/app/picture_marks.h"

#include <gtest/gtest.h>

namespace sonocase::runtime {
namespace {

TEST(Measurements, TwoClicksMeasureADistance) {
    Measurements measurements;
    measurements.click(1, 2);
    EXPECT_TRUE(measurements.begun());
    EXPECT_TRUE(measurements.done().empty());
    measurements.click(4, 6);
    EXPECT_FALSE(measurements.begun());
    ASSERT_EQ(measurements.done().size(), 1u);
    EXPECT_DOUBLE_EQ(measurements.done()[0].length_mm(), 5);
}

TEST(Measurements, TheLastTwoAreKept) {
    Measurements measurements;
    for (int i = 1; i <= 3; ++i) {
        measurements.click(0, 0);
        measurements.click(i, 0);
    }
    ASSERT_EQ(measurements.done().size(), 2u);
    EXPECT_DOUBLE_EQ(measurements.done()[0].length_mm(), 2);
    measurements.click(0, 0);
    measurements.clear();
    EXPECT_TRUE(measurements.done().empty());
    EXPECT_FALSE(measurements.begun());
}

}  // namespace
}  // namespace sonocase::runtime
