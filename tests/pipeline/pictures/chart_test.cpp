// SPDX-License-Identifier: Apache-2.0

#include "pipeline/pictures/chart.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>

namespace sonocase::pipeline {
namespace {

std::string read_all(const std::string& path) {
    std::ifstream file(path, std::ios::binary);
    return {std::istreambuf_iterator<char>(file), {}};
}

ChartSheet sheet() {
    Chart chart{"Error against time", "seconds", "error in mm", true, true, {}};
    Series front{"front", {}, {}, SeriesLook::line_and_points, {0, 0, 0}, 2};
    for (int i = 1; i <= 8; ++i) {
        front.x.push_back(0.1 * i * i);
        front.y.push_back(2.0 / i);
    }
    front.x.push_back(-1);  // no logarithm: left out
    front.y.push_back(NAN);
    chart.series.push_back(front);
    chart.series.push_back({"paper", {3}, {1.5}, SeriesLook::points, {200, 0, 0}, 4});
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

TEST(Chart, FolderThatCannotBeIsAnErrorThatNamesTheFile) {
    const std::string file = ::testing::TempDir() + "chart_file";
    std::ofstream(file) << "no folder";
    const Status status = write_chart_png(sheet(), file + "/chart.png");
    ASSERT_FALSE(status);
    EXPECT_NE(status.error().message().find("chart_file/chart.png"), std::string::npos);
}

}  // namespace
}  // namespace sonocase::pipeline
