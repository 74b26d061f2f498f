// SPDX-License-Identifier: Apache-2.0

#include "runtime/player/app/picture_pace.h"

#include <gtest/gtest.h>

#include <algorithm>

namespace sonocase::runtime {
namespace {

struct Outcome {
    int pictures = 0, drawings = 0;
    double longest_gap_s = 0;
};

// `seconds` of pictures that take plain_s, and drawing_s more where the view is drawn.
Outcome watch(double plain_s, double drawing_s, double seconds) {
    ViewPace pace;
    Outcome out;
    double now = 0, drawn = 0;
    while (now < seconds) {
        const bool draw = pace.due(now);
        ++out.pictures;
        if (draw) {
            ++out.drawings;
            out.longest_gap_s = std::max(out.longest_gap_s, now - drawn);
            drawn = now;
        }
        now += plain_s + (draw ? drawing_s : 0);
    }
    return out;
}

TEST(ViewPace, FastDrawingsComeWithEverySecondPicture) {
    const Outcome r = watch(1.0 / 60, 0, 10);
    EXPECT_NEAR(r.drawings, r.pictures / 2, 2);
}

TEST(ViewPace, SlowDrawingsTakeASeventhOfTheTime) {
    const Outcome r = watch(0.012, 0.06, 10);
    EXPECT_NEAR(r.drawings * 0.06 / 10, 0.15, 0.03);
}

TEST(ViewPace, TheViewNeverSeemsToHang) {
    EXPECT_LT(watch(0.02, 1.0, 30).longest_gap_s, 1.6);  // half a second, a drawing, a picture
    EXPECT_LT(watch(0.2, 0.0, 30).longest_gap_s, 0.5);
}

TEST(ViewPace, DrawsAtOnce) {
    EXPECT_TRUE(ViewPace().due(7));
}

}  // namespace
}  // namespace sonocase::runtime
