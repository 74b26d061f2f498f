// SPDX-License-Identifier: Apache-2.0

#include "runtime/display/key_taps.h"

#include <gtest/gtest.h>

namespace sonocase::runtime {
namespace {

TEST(KeyTaps, ATapShorterThanAPictureIsHeldForOne) {
    KeyTaps<4> taps;
    bool down[4] = {};
    taps.press(2);  // and up again before the picture begins
    taps.hold(down);
    EXPECT_TRUE(down[2]);
    taps.release(down);
    EXPECT_FALSE(down[2]);
    taps.hold(down);  // once only
    EXPECT_FALSE(down[2]);
}

TEST(KeyTaps, AKeyThatIsHeldStaysDown) {
    KeyTaps<4> taps;
    bool down[4] = {};
    taps.press(1);
    down[1] = true;
    taps.hold(down);
    taps.release(down);
    EXPECT_TRUE(down[1]);
}

// Two presses between two pictures, and one more while the first is shown.
TEST(KeyTaps, EveryPressGoesDownInAPictureOfItsOwn) {
    KeyTaps<4> taps;
    taps.press(3);
    taps.press(3);
    int presses = 0;
    bool before = false;
    for (int picture = 0; picture < 8; ++picture) {
        if (picture == 1) taps.press(3);
        bool down[4] = {};
        taps.hold(down);
        presses += down[3] && !before;
        before = down[3];
        taps.release(down);
        EXPECT_FALSE(down[3]);
    }
    EXPECT_EQ(presses, 3);
    EXPECT_FALSE(taps.waiting());
}

// Shift + V as one tap: Shift is up again when the picture begins.
TEST(KeyTaps, ModifiersGoWithTheirPress) {
    KeyTaps<4> taps;
    bool down[4] = {};
    taps.press(1, 5);
    EXPECT_TRUE(taps.waiting());
    EXPECT_EQ(taps.hold(down), 5);
    taps.release(down);
    EXPECT_EQ(taps.hold(down), 0);
}

TEST(KeyTaps, UnknownKeysAreLeftOut) {
    KeyTaps<4> taps;
    bool down[4] = {};
    for (const int key : {-1, 4, 1000}) taps.press(key);
    taps.hold(down);
    for (const bool held : down) EXPECT_FALSE(held);
}

}  // namespace
}  // namespace sonocase::runtime
