// SPDX-License-Identifier: Apache-2.0

#include "runtime/player/app/picture_marks.h"

#include <gtest/gtest.h>

#include <cstdio>

namespace sonocase::runtime {
namespace {

TEST(PictureMarks, TheDraggedBoxFillsTheAreaAndATapDoesNot) {
    PictureZoom zoom;
    zoom_to(zoom, 10, 20, 12, 21, 200, 150);  // a tap
    EXPECT_FALSE(zoom.on());
    zoom_to(zoom, 30, 60, -10, 40, 200, 150);  // drawn from the lower right
    EXPECT_DOUBLE_EQ(zoom.factor, 5);          // 40 mm wide in 200; 20 mm in 150 would be 7.5
    EXPECT_DOUBLE_EQ(zoom.x_mm, 10);
    EXPECT_DOUBLE_EQ(zoom.z_mm, 50);
    zoom_to(zoom, 0, 0, 6, 6, 200, 150);
    EXPECT_DOUBLE_EQ(zoom.factor, 8);  // never more
    zoom_to(zoom, 0, 0, 900, 900, 200, 150);
    EXPECT_DOUBLE_EQ(zoom.factor, 1);  // never less than the whole
}

TEST(PictureMarks, ZoomGoesOnAndBack) {
    PictureMarks marks;
    toggle_zoom(marks);
    EXPECT_EQ(marks.tool, MarkTool::zoom);
    marks.zoom.factor = 3;
    marks.tool = MarkTool::none;
    toggle_zoom(marks);
    EXPECT_FALSE(marks.zoom.on());
    EXPECT_EQ(marks.tool, MarkTool::none);
}

TEST(PictureMarks, WordsAreKeptUpToEight) {
    PictureMarks marks;
    for (int i = 0; i < 10; ++i) {
        marks.placing = {double(i), 0, ""};
        std::snprintf(marks.words, sizeof marks.words, "%d", i);
        add_label(marks);
    }
    ASSERT_EQ(marks.labels.size(), kMaxLabels);
    EXPECT_EQ(marks.labels.front().words, "2");
    EXPECT_EQ(marks.labels.back().x_mm, 9);
    add_label(marks);  // nothing was typed
    EXPECT_EQ(marks.labels.back().words, "9");
}

}  // namespace
}  // namespace sonocase::runtime
