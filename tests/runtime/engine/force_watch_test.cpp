// SPDX-License-Identifier: Apache-2.0

#include "runtime/engine/sensor_watch.h"
#include "support/hard_case.h"

#include <gtest/gtest.h>

#include <cmath>

namespace sonocase::runtime {
namespace {

using testing::HardCase;

TEST(ForceWatch, WithoutASensorThereIsNone) {
    ForceWatch watch;
    watch.observe(-1, 0);
    watch.observe(NAN, 1);
    EXPECT_FALSE(watch.present());
    EXPECT_EQ(watch.force_n(), 0);
}

TEST(ForceWatch, FollowsAHandAndSaysOnlyWhatChanged) {
    ForceWatch watch;
    for (int n = 0; n <= 50; ++n) watch.observe(0.2 * n, 0.02 * n);
    EXPECT_TRUE(watch.present());
    EXPECT_NEAR(watch.force_n(), 10, 1e-12);
    EXPECT_TRUE(watch.fresh());
    watch.taken();
    watch.observe(10.01, 1.02);  // less than what needs a new picture
    EXPECT_FALSE(watch.fresh());
    watch.observe(0, 1.1);
    EXPECT_TRUE(watch.fresh());
    EXPECT_EQ(watch.force_n(), 0);
}

TEST(ForceWatch, AJumpIsBelievedOnceItIsConfirmed) {
    ForceWatch watch;
    watch.observe(3, 0);
    watch.observe(3.1, 0.01);
    watch.observe(60, 0.02);  // 57 N in 10 ms
    EXPECT_NEAR(watch.force_n(), 3.1, 1e-12);
    watch.observe(3.2, 0.03);
    EXPECT_NEAR(watch.force_n(), 3.2, 1e-12);
    watch.observe(60, 0.04);
    watch.observe(60.5, 0.05);
    EXPECT_NEAR(watch.force_n(), 60.5, 1e-12);
    HardCase jump("force after 1e9 N, infinity and NaN, off", HardCase::at_most, 1e-12, "N");
    for (const double fault : {1e9, double(INFINITY), double(NAN), 101.0})
        watch.observe(fault, 0.06);
    jump.see(std::abs(watch.force_n() - 60.5));
}

TEST(ForceWatch, AFrozenSensorLetsGo) {
    ForceWatch watch;
    for (int n = 0; n < 60; ++n) watch.observe(7, 0.02 * n);
    EXPECT_TRUE(watch.frozen());
    HardCase held("force of a sensor frozen for a second", HardCase::at_most, 0, "N");
    held.see(watch.force_n());
    for (int n = 0; n < 10; ++n) watch.observe(7 + 0.1 * n, 1.2 + 0.02 * n);
    EXPECT_FALSE(watch.frozen());
    EXPECT_NEAR(watch.force_n(), 7.9, 1e-12);
    // Nothing on the face is not frozen.
    ForceWatch idle;
    for (int n = 0; n < 200; ++n) idle.observe(0, 0.02 * n);
    EXPECT_FALSE(idle.frozen());
}

}  // namespace
}  // namespace sonocase::runtime
