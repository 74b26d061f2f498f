// SPDX-License-Identifier: Apache-2.0

#include "pipeline/pictures/chart.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>

#include "pipeline/pictures/chart_legend.h"

namespace sonocase::pipeline {
namespace {

std::string read_all(const std::string& path) {
    std::ifstream file(path, std::ios::binary);
    return {std::istreambuf_iterator<char>(file), {}};
}

ChartSheet sheet() {
    Chart chart{"Error against time", "seconds", "error in mm", true, true, {}};
    Series front{"front", {}, {}, SeriesStyle::line_and_points, {0, 0, 0}, 2};
    for (int i = 1; i <= 8; ++i) {
        front.x.push_back(0.1 * i * i);
        front.y.push_back(2.0 / i);
    }
    front.x.push_back(-1);  // no logarithm: left out
    front.y.push_back(NAN);
    chart.series.push_back(front);
    chart.series.push_back({"paper", {3}, {1.5}, SeriesStyle::points, {200, 0, 0}, 4});
    return {{chart, chart}, 2, 500, 360};
}

TEST(Chart, PngIsWrittenWithoutADisplayAndTheSameTwice) {
    unsetenv("DISPLAY");  // as on a farm node
    const std::string folder = ::testing::TempDir();
    ASSERT_TRUE(write_chart_png(sheet(), folder + "chart_a.png"));
    ASSERT_TRUE(write_chart_png(sheet(), folder + "chart_b.png"));
    const std::string a = read_all(folder + "chart_a.png");
    EXPECT_GT(a.size(), 5000u);
    EXPECT_EQ(a.substr(1, 3), "PNG");
    EXPECT_EQ(a, read_all(folder + "chart_b.png"));
    EXPECT_FALSE(std::filesystem::exists(folder + "chart_a.png.part"));
}

TEST(Chart, SvgHoldsTheTitle) {
    const std::string path = ::testing::TempDir() + "chart.svg";
    ASSERT_TRUE(write_chart_svg(sheet(), path));
    const std::string svg = read_all(path);
    EXPECT_NE(svg.find("<svg"), std::string::npos);
    for (const char* words : {"Error against time", "seconds", "error in mm", "front", "paper"}) {
        EXPECT_NE(svg.find(words), std::string::npos) << words;
    }
}

// The names that the trade-off plots show, and longer ones.
std::vector<LegendItem> six_items() {
    return {
        {"settings tried", SeriesStyle::points, {190, 190, 190, 255}, 2.5},
        {"Pareto front", SeriesStyle::line_and_points, {0, 114, 178, 255}, 2},
        {"preset draft: 2.0 mm voxels, no residual warp", SeriesStyle::points, {9, 9, 9, 255}, 4.5},
        {"preset standard", SeriesStyle::diamonds, {9, 9, 9, 255}, 4.5},
        {"preset best", SeriesStyle::crosses, {9, 9, 9, 255}, 4.5},
        {"paper", SeriesStyle::dashed, {9, 9, 9, 255}, 12}};
}

// Rows: each thing's name and value beside its bar, none of them on another or out of the picture.
TEST(Chart, RowsHaveTheirNamesAndValuesAndNoAxis) {
    Chart chart;
    chart.rows = true;
    for (int n = 1; n <= 8; ++n)
        chart.series.push_back({"thing " + std::to_string(n), {0}, {11.1 * n}, SeriesStyle::bars});
    chart.series.push_back({"with help", {2}, {5}, SeriesStyle::diamonds});
    const std::string svg = chart_svg({{chart}, 1, 400, 420});
    std::vector<double> heights;
    for (int n = 1; n <= 8; ++n) {
        const std::size_t name = svg.find(">thing " + std::to_string(n) + "<");
        ASSERT_NE(name, std::string::npos) << n;
        const std::size_t from = svg.rfind(" y=\"", name);
        ASSERT_NE(from, std::string::npos);
        heights.push_back(std::stod(svg.substr(from + 4)));
        if (n > 1) {
            EXPECT_GT(heights[n - 1] - heights[n - 2], 30);
        }
    }
    EXPECT_LT(heights.back(), 400);
    for (const char* words : {">11.1<", ">88.8<", ">with help<"})
        EXPECT_NE(svg.find(words), std::string::npos) << words;
    EXPECT_EQ(svg.find(">50<"), std::string::npos);
}

TEST(ChartLegend, FrameHoldsWordsAndSymbolsAndNothingOverlaps) {
    const Legend legend = lay_out_legend(six_items(), 700);
    ASSERT_EQ(legend.entries.size(), 6u);
    double above = legend.height;
    for (const LegendEntry& e : legend.entries) {
        for (const LegendBox& box : {e.symbol, e.words}) {
            EXPECT_GT(box.left, 0);
            EXPECT_GT(box.bottom, 0);
            EXPECT_LT(box.left + box.width, legend.width) << e.item.name;
            EXPECT_LT(box.bottom + box.height, above) << e.item.name;
        }
        EXPECT_LT(e.symbol.left + e.symbol.width, e.words.left) << e.item.name;
        EXPECT_GT(e.words.width, 4.0 * static_cast<double>(e.item.name.size())) << e.item.name;
        above = e.symbol.bottom;
    }
    EXPECT_EQ(legend.entries[2].item.name, six_items()[2].name);  // not shortened
}

TEST(ChartLegend, NamesThatDoNotFitAreShortenedBetweenCharacters) {
    std::vector<LegendItem> items = six_items();
    items[0].name.clear();
    for (int i = 0; i < 200; ++i) items[0].name += "\xc3\xa4";  // a with two dots
    const Legend legend = lay_out_legend(items, 250);
    EXPECT_LE(legend.width, 250);
    const std::string& name = legend.entries[0].item.name;
    ASSERT_TRUE(name.ends_with("..."));
    EXPECT_EQ((name.size() - 3) % 2, 0u);
    EXPECT_GT(name.size(), 20u);
    EXPECT_EQ(lay_out_legend({}, 250).width, 0);
}

TEST(ChartLegend, IsDrawnOutsideThePlotWhereItIsLong) {
    ChartSheet one;
    one.charts.push_back(sheet().charts[0]);
    one.charts[0].series.clear();
    for (const LegendItem& item : six_items())
        one.charts[0].series.push_back({item.name, {1, 2, 3}, {3, 2, 1}, item.style});
    const std::string path = ::testing::TempDir() + "chart_legend";
    ASSERT_TRUE(write_chart_svg(one, path + ".svg"));
    ASSERT_TRUE(write_chart_png(one, path + ".png"));
    const std::string svg = read_all(path + ".svg");
    for (const LegendItem& item : six_items())
        EXPECT_NE(svg.find(">" + item.name + "<"), std::string::npos) << item.name;
}

TEST(Chart, FolderThatCannotBeIsAnErrorThatNamesTheFile) {
    const std::string file = ::testing::TempDir() + "chart_file";
    std::ofstream(file) << "no folder";
    const Status status = write_chart_png(sheet(), file + "/chart.png");
    ASSERT_FALSE(status);
    EXPECT_NE(status.error().message().find("chart_file/chart.png"), std::string::npos);
}

}  // namespace
}  // namespace sonocase::pipeline
