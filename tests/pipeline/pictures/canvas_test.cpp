// SPDX-License-Identifier: Apache-2.0

#include "pipeline/pictures/canvas.h"

#include <gtest/gtest.h>

namespace sonocase::pipeline {
namespace {

TEST(Canvas, FillsByCoverage) {
    Canvas canvas(10, 10);
    const std::vector<CanvasPoint> box{{2, 3}, {5.5, 3}, {5.5, 7}, {2, 7}};
    canvas.fill(box, {0, 0, 0, 255});
    const auto grey = [&](int x, int y) {
        return canvas.rgb()[3 * static_cast<std::size_t>((9 - y) * 10 + x)];
    };
    EXPECT_EQ(grey(3, 5), 0);
    EXPECT_EQ(grey(1, 5), 255);
    EXPECT_NEAR(grey(5, 5), 127, 1);  // half covered
    EXPECT_EQ(grey(3, 2), 255);
    EXPECT_EQ(grey(3, 7), 255);
}

TEST(Canvas, ClipHoldsAndSvgIsClosed) {
    Canvas canvas(20, 20);
    canvas.clip(5, 5, 5, 5);
    const std::vector<CanvasPoint> all{{0, 0}, {20, 0}, {20, 20}, {0, 20}};
    canvas.fill(all, {255, 0, 0, 255});
    int inside = 0;
    for (std::size_t i = 0; i < canvas.rgb().size(); i += 3) inside += canvas.rgb()[i + 1] == 0;
    EXPECT_EQ(inside, 25);
    const std::string svg = canvas.svg();
    EXPECT_NE(svg.find("<g clip-path"), std::string::npos);
    EXPECT_NE(svg.find("</g>\n</svg>"), std::string::npos);
}

}  // namespace
}  // namespace sonocase::pipeline
