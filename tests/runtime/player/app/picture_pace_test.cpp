// SPDX-License-Identifier: Apache-2.0

#include "runtime/player/app/picture_pace.h"

#include <gtest/gtest.h>

namespace sonocase::runtime {
namespace {

TEST(PicturePace, NothingIsDrawnWhereNothingMoves) {
    Stillness now;
    now.input_s_ago = 10;
    EXPECT_EQ(longest_wait_s(now), kNoPicture);
    now.notice = true;  // it has to go in time
    EXPECT_EQ(longest_wait_s(now), kStillTime);
    now.notice = false;
    now.typing = true;
    EXPECT_EQ(longest_wait_s(now), kStillTime);
    now.loading = true;
    EXPECT_EQ(longest_wait_s(now), kLoadingTime);
    now.key_held = true;
    EXPECT_EQ(longest_wait_s(now), kPictureTime);
    now = {};
    now.scanning = true;
    now.input_s_ago = 10;
    EXPECT_EQ(longest_wait_s(now), kPictureTime);
}

TEST(PicturePace, PicturesFollowAnInputUntilItsTooltipIsThere) {
    Stillness now;
    for (const double ago : {0.0, 0.5, 1.4}) {
        now.input_s_ago = ago;
        EXPECT_EQ(longest_wait_s(now), kStillTime) << ago;
    }
    now.input_s_ago = kAfterInput;
    EXPECT_EQ(longest_wait_s(now), kNoPicture);
}

}  // namespace
}  // namespace sonocase::runtime
