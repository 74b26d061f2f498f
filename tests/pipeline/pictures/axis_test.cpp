// SPDX-License-Identifier: Apache-2.0

#include "pipeline/pictures/axis.h"

#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "pipeline/pictures/svg.h"

namespace sonocase::pipeline {
namespace {

std::vector<std::string> labels_of(const Axis& axis, bool upright = false) {
    std::vector<std::string> labels;
    for (const Tick& tick : fitting_ticks(axis, upright))
        if (!tick.label.empty()) labels.push_back(tick.label);
    return labels;
}

TEST(Axis, StepsAreRound) {
    EXPECT_DOUBLE_EQ(round_step(1, 10), 0.1);
    EXPECT_DOUBLE_EQ(round_step(7, 4), 2);
    EXPECT_DOUBLE_EQ(round_step(21, 5), 5);
    EXPECT_DOUBLE_EQ(round_step(99, 10), 10);
    EXPECT_EQ(multiples_between(-0.25, 0.5, 0.25), (std::vector<double>{-0.25, 0, 0.25, 0.5}));
}

TEST(Axis, LabelsShareTheirDecimalsOrUsePowersOfTen) {
    EXPECT_EQ(labels_of({{-0.1, 1.05}, false, 0, 130}),
              (std::vector<std::string>{"0", "0.5", "1.0"}));
    EXPECT_EQ(labels_of({{-2.2e6, 2.2e6}, false, 0, 150}),
              (std::vector<std::string>{"-2e6", "0", "2e6"}));
    EXPECT_EQ(labels_of({{0.4, 30}, true, 0, 400}),
              (std::vector<std::string>{"0.5", "1", "2", "5", "10", "20"}));
}

TEST(Axis, LabelsNeverOverlap) {
    for (const bool log : {false, true}) {
        for (const double high : {1.3, 2.0, 7e3, 4e9}) {
            for (const double length_px : {30.0, 90.0, 400.0}) {
                const Axis axis{{1, high}, log, 0, length_px};
                double end = -1e9;
                for (const Tick& tick : fitting_ticks(axis, false)) {
                    if (tick.label.empty()) continue;
                    const double half = 0.5 * text_width_px(tick.label, kTickStyle);
                    EXPECT_GT(axis.place(tick.value) - half, end) << tick.label << " " << length_px;
                    end = axis.place(tick.value) + half;
                }
            }
        }
    }
}

TEST(Axis, EqualAxesShowAUnitWithOneLength) {
    Axis x{{0, 10}, false, 0, 300}, y{{0, 1}, false, 0, 100};
    equalise(x, y);
    EXPECT_DOUBLE_EQ(x.place(1) - x.place(0), y.place(1) - y.place(0));
    EXPECT_DOUBLE_EQ(y.place(0.5), 50);
}

TEST(Svg, EscapesTextsAndTitlesAndRoundsNumbers) {
    EXPECT_EQ(svg_number(-0.001), "0");
    EXPECT_EQ(svg_number(12.3456), "12.35");
    Svg svg;
    svg.open_group("class=\"event\"", "<b>");
    svg.text(1, 2, "a & b", "");
    svg.close_group();
    const std::string text = svg.picture(10, 20, "class=\"p\"");
    EXPECT_NE(text.find("<svg viewBox=\"0 0 10 20\" class=\"p\">"), std::string::npos);
    EXPECT_NE(text.find("<title>&lt;b&gt;</title>"), std::string::npos);
    EXPECT_NE(text.find(">a &amp; b</text>"), std::string::npos);
}

}  // namespace
}  // namespace sonocase::pipeline
