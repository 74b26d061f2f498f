// SPDX-License-Identifier: Apache-2.0

#include "formats/recording/poses.h"

#include <gtest/gtest.h>

#include <filesystem>

#include "formats/files/load_save.h"
#include "support/paths.h"
#include "support/random.h"

namespace sonocase {
namespace {

constexpr const char* kHeader =
    "frame,timestamp_s,status,tx,ty,tz,r00,r01,r02,r10,r11,r12,r20,r21,r22\n";

TEST(Poses, ComeBackAsTheyWere) {
    testing::Random random(8);
    std::vector<Pose> poses;
    for (int i = 0; i < 50; ++i) {
        poses.push_back({i * 3, random.uniform(0, 100), i % 5 != 0, random.rigid(500)});
    }
    poses[7].tracker_from_tool.translation.x = NAN;
    const auto back = parse_poses(format_poses(poses), "p.csv");
    ASSERT_TRUE(back) << back.error().message();
    ASSERT_EQ(back->size(), poses.size());
    for (std::size_t i = 0; i < poses.size(); ++i) {
        EXPECT_EQ((*back)[i].frame, poses[i].frame);
        EXPECT_EQ((*back)[i].timestamp_s, poses[i].timestamp_s);
        EXPECT_EQ((*back)[i].ok, poses[i].ok);
        if (i != 7) {
            EXPECT_EQ((*back)[i].tracker_from_tool, poses[i].tracker_from_tool);
        }
    }
    EXPECT_TRUE(std::isnan((*back)[7].tracker_from_tool.translation.x));
}

TEST(Poses, AcceptsWindowsLineEndsAByteOrderMarkAndNoLastLineEnd) {
    const std::string header(kHeader, std::string(kHeader).size() - 1);
    const auto poses = parse_poses(
        "\xEF\xBB\xBF" + header +
            "\r\n1,0.5,OK,1,2,3,1,0,0,0,1,0,0,0,1\r\n\r\n2,1,MISSING,0,0,0,1,0,0,0,1,0,0,0,1",
        "p.csv");
    ASSERT_TRUE(poses) << poses.error().message();
    ASSERT_EQ(poses->size(), 2u);
    EXPECT_TRUE((*poses)[0].ok);
    EXPECT_FALSE((*poses)[1].ok);
    EXPECT_EQ((*poses)[0].tracker_from_tool.translation, (Vector3{1, 2, 3}));
}

TEST(Poses, FaultsNameTheLine) {
    const std::string row = "1,0.5,OK,1,2,3,1,0,0,0,1,0,0,0,1\n";
    const auto number = parse_poses(kHeader + row + "2,x,OK,1,2,3,1,0,0,0,1,0,0,0,1\n", "p.csv");
    ASSERT_FALSE(number);
    EXPECT_EQ(number.error().where, "p.csv:3");
    const auto cells = parse_poses(std::string(kHeader) + "1,2,OK\n", "p.csv");
    ASSERT_FALSE(cells);
    EXPECT_NE(cells.error().message().find("3 cells"), std::string::npos);
    EXPECT_FALSE(parse_poses("", "p.csv"));
    EXPECT_FALSE(parse_poses("1,2,3\n", "p.csv"));
    EXPECT_TRUE(parse_poses(kHeader, "p.csv")->empty());
}

TEST(Poses, RealRecordingsAreRead) {
    const std::string path = std::string(SONOCASE_DATA) + "/tracking/pivot_optical_yaniv/poses.csv";
    if (!std::filesystem::exists(path)) GTEST_SKIP() << path << " is absent";
    const auto poses = load_poses(path);
    ASSERT_TRUE(poses) << poses.error().message();
    EXPECT_EQ(poses->size(), 481u);
    for (const Pose& pose : *poses)
        EXPECT_LT(orthonormality_error(pose.tracker_from_tool.rotation), 1e-6);
}

}  // namespace
}  // namespace sonocase
