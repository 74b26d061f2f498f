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

TEST(KeyTaps, UnknownKeysAreLeftOut) {
    KeyTaps<4> taps;
    bool down[4] = {};
    for (const int key : {-1, 4, 1000}) taps.press(key);
    taps.hold(down);
    for (const bool held : down) EXPECT_FALSE(held);
}

}  // namespace
}  // namespace sonocase::runtime
