// SPDX-License-Identifier: Apache-2.0

#include "formats/recording/poses.h"

#include <gtest/gtest.h>

#include <filesystem>

#include "formats/files/load_save.h"
#include "formats/recording/session.h"
#include "formats/text/number_text.h"
#include "support/paths.h"
#include "support/random.h"
#include "support/recording_forms.h"
#include "support/temporary_folder.h"

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

TEST(Poses, ProbeAndNeedleAreTwoFilesInThisOrder) {
    const testing::TemporaryFolder folder;
    const std::string text = format_poses(testing::tool_poses(1, 0));
    const std::string probe = folder.write("probe.csv", text),
                      needle = folder.write("needle.csv", text);
    EXPECT_TRUE(load_recording_file(probe + "," + needle));
    const auto same = load_recording_file(probe + "," + probe);
    ASSERT_FALSE(same);
    EXPECT_EQ(same.error().what, "probe and needle are one file");
    const auto swapped = load_recording_file(needle + "," + probe);
    ASSERT_FALSE(swapped);
    EXPECT_EQ(swapped.error().what, "the needle's file comes first by its name");
}

TEST(Poses, OneRecordingIsTheSameInEveryForm) {
    const std::vector<Pose> probe = testing::tool_poses(1, 0), needle = testing::tool_poses(2, 7);
    const testing::TemporaryFolder folder;
    const std::vector<std::string> forms = testing::write_recording_forms(folder, probe, needle);
    for (const std::string& form : forms) {
        const auto read = load_recording_file(form);
        ASSERT_TRUE(read) << read.error().message();
        const auto session = session_from_sequence(*read, guess_names(*read), form);
        ASSERT_TRUE(session) << session.error().message();
        ASSERT_EQ(session->samples.size(), probe.size()) << form;
        for (std::size_t i = 0; i < probe.size(); ++i) {
            const SessionSample& s = session->samples[i];
            EXPECT_NEAR(s.time_s, probe[i].timestamp_s, 1e-9) << form;
            ASSERT_TRUE(s.probe_ok) << form << " " << i;
            ASSERT_EQ(s.needle_ok, needle[i].ok) << form << " " << i;
            const auto expect_same = [&](const Rigid& a, const Rigid& b) {
                EXPECT_LT(norm(a.translation - b.translation), 1e-9) << form;
                for (std::size_t k = 0; k < 9; ++k)
                    EXPECT_NEAR(a.rotation.m[k], b.rotation.m[k], 1e-9) << form;
            };
            expect_same(s.mannequin_from_probe, probe[i].tracker_from_tool);
            if (s.needle_ok) expect_same(s.mannequin_from_needle, needle[i].tracker_from_tool);
        }
    }
}

TEST(Poses, TablesThatSayTooLittleAreRefusedWithTheCure) {
    const auto fault = [](const std::string& csv) {
        const auto read = parse_poses(csv, "p.csv");
        return read ? std::string() : read.error().message();
    };
    EXPECT_NE(fault("q0,q1,q2,q3,tx,ty,tz\n1,0,0,0,1,2,3\n").find("qw, qx, qy, qz"),
              std::string::npos);
    EXPECT_NE(fault("a;b;c\n1;2;3\n").find("found a;b;c"), std::string::npos);
    EXPECT_NE(fault("1,2,3\n").find("no line that names"), std::string::npos);
    EXPECT_NE(fault("\xFF\xFE"
                    "f")
                  .find("UTF-16"),
              std::string::npos);
    EXPECT_NE(fault("qw,qx,qy,qz,tx,ty,tz\n0.2,0,0,0,1,2,3\n").find("length"), std::string::npos);
    EXPECT_NE(fault("qw;qx;qy;qz;tx;ty;tz\n1;0;0;0;1.234,5;2;3\n").find("not a number"),
              std::string::npos);
    std::string ms = "time,qw,qx,qy,qz,tx,ty,tz\n";
    for (int i = 0; i < 20; ++i) ms += std::to_string(i * 16.7) + ",1,0,0,0,1,2,3\n";
    EXPECT_NE(fault(ms).find("time_ms"), std::string::npos);
    // Metres by name.
    const auto metres = parse_poses("qw,qx,qy,qz,tx_m,ty_m,tz_m\n1,0,0,0,0.1,0.2,0.3\n", "p.csv");
    ASSERT_TRUE(metres) << metres.error().message();
    EXPECT_EQ((*metres)[0].tracker_from_tool.translation, (Vector3{100, 200, 300}));
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
