#include "pipeline/plot/chart.h"

#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>

#include "formats/atomic_file.h"
#include "pipeline/plot/canvas.h"

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

TEST(Chart, DrawsWithoutADisplayTheSameBytesTwice) {
    unsetenv("DISPLAY");
    Chart chart;
    chart.title = "error against time";
    chart.x_title = "seconds";
    chart.y_title = "error [mm]";
    chart.log_x = chart.log_y = true;
    ChartSeries s;
    s.name = "measured";
    s.line_px = 2;
    s.marker_px = 8;
    for (int i = 1; i < 30; ++i) {
        s.x.push_back(0.01 * i * i);
        s.y.push_back(3.0 / i);
    }
    s.x.push_back(-1);  // left out on a logarithmic axis
    s.y.push_back(NAN);
    chart.series.push_back(s);
    ChartSeries one;
    one.name = "preset";
    one.x = {1};
    one.y = {0.5};
    one.marker_px = 12;
    one.marker = ChartSeries::Marker::diamond;
    one.colour = {200, 40, 40};
    chart.series.push_back(one);
    const std::filesystem::path folder =
        std::filesystem::path(::testing::TempDir()) / "sonocase_chart";
    std::filesystem::create_directories(folder);
    const std::vector<std::string> first{folder / "a.png", folder / "a.svg"},
        second{folder / "b.png", folder / "b.svg"};
    const std::vector<Chart> charts{chart, chart};
    ASSERT_TRUE(draw_charts(charts, 2, 480, 360, first));
    ASSERT_TRUE(draw_charts(charts, 2, 480, 360, second));
    for (std::size_t i = 0; i < 2; ++i) {
        const auto a = read_file(first[i]), b = read_file(second[i]);
        ASSERT_TRUE(a && b);
        EXPECT_EQ(*a, *b);
        EXPECT_GT(a->size(), 2000u);
    }
    const auto svg = read_text_file(first[1]);
    for (const char* words : {"error against time", "seconds", "error [mm]", "preset"}) {
        EXPECT_NE(svg->find(words), std::string::npos) << words;
    }
}

TEST(Chart, FolderThatIsNotThereIsAnError) {
    const std::vector<std::string> paths{"/nonexistent/folder/a.png"};
    EXPECT_FALSE(draw_charts(std::vector<Chart>(1), 1, 200, 200, paths));
}

}  // namespace
}  // namespace sonocase::pipeline
