// SPDX-License-Identifier: Apache-2.0

// The verb as a program: keys of the JSON, exit status, files.
#include <gtest/gtest.h>

#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>

#include "formats/calibration/calibration.h"
#include "formats/files/atomic_file.h"
#include "formats/files/load_save.h"
#include "formats/recording/poses.h"
#include "support/calibration_motion.h"
#include "support/paths.h"

namespace sonocase::pipeline {
namespace {

using testing::pivot_recording;
using testing::PivotMotion;
using testing::Random;

class CalibrateVerb : public ::testing::Test {
  protected:
    void SetUp() override {
        folder_ = std::filesystem::path(::testing::TempDir()) /
                  (std::string("sonocase_") +
                   ::testing::UnitTest::GetInstance()->current_test_info()->name());
        std::filesystem::remove_all(folder_);
        std::filesystem::create_directories(folder_);
    }
    std::string path(const std::string& name) const { return (folder_ / name).string(); }
    void save(const std::string& name, const std::vector<Pose>& poses) const {
        ASSERT_TRUE(write_file(path(name), std::string_view(format_poses(poses))));
    }
    int run(const std::string& arguments) {
        const std::string command = std::string("env -u DISPLAY ") + SONOCASE_BIN +
                                    "/sonocase calibrate " + arguments + " >" + path("out") +
                                    " 2>" + path("err");
        const int status = std::system(command.c_str());
        out_ = *read_text_file(path("out"));
        err_ = *read_text_file(path("err"));
        return WEXITSTATUS(status);
    }
    std::filesystem::path folder_;
    std::string out_, err_;
};

TEST_F(CalibrateVerb, PointPrintsItsKeysSavesAndDraws) {
    Random random(1);
    PivotMotion motion;
    motion.noise_mm = 0.1;
    save("poses.csv", pivot_recording(motion, random));
    ASSERT_EQ(run("point --poses " + path("poses.csv") + " --json -o " + path("cal.json") +
                  " --pictures " + path("pictures") + " --date 2026-01-02T03:04:05Z --report " +
                  path("report.json")),
              0)
        << err_;
    const auto json = nlohmann::json::parse(out_);
    for (const char* key : {"tip_mm", "pivot_mm", "rms_mm", "sigma_mm", "condition", "poses",
                            "inliers", "left_out_shift_mm", "warnings"}) {
        EXPECT_TRUE(json.contains(key)) << key;
    }
    EXPECT_NEAR(json["tip_mm"][2].get<double>(), motion.tip_mm.z, 0.1);
    EXPECT_EQ(json["poses"], 100);
    EXPECT_EQ(json["left_out_shift_mm"], 0);
    EXPECT_EQ(json["residuals"].size(), 100u);
    EXPECT_TRUE(err_.empty()) << err_;
    const auto saved = load_calibration(path("cal.json"));
    ASSERT_TRUE(saved);
    EXPECT_EQ(saved->date, "2026-01-02T03:04:05Z");
    EXPECT_FALSE(saved->data_digest.empty());
    EXPECT_NEAR(saved->sensor_from_tool.translation.x, json["tip_mm"][0].get<double>(), 0);
    EXPECT_TRUE(std::filesystem::exists(path("pictures/point.png")));
    EXPECT_TRUE(std::filesystem::exists(path("pictures/point.svg")));
    EXPECT_TRUE(nlohmann::json::parse(*read_text_file(path("report.json"))).contains("rms_mm"));
}

TEST_F(CalibrateVerb, NoAnswerIsOneLineExitOneAndNoFile) {
    Random random(2);
    save("poses.csv", std::vector<Pose>(40, pivot_recording({}, random)[0]));
    EXPECT_EQ(run("point --poses " + path("poses.csv") + " --json -o " + path("cal.json")), 1);
    EXPECT_FALSE(std::filesystem::exists(path("cal.json")));
    EXPECT_NE(err_.find("stood still"), std::string::npos) << err_;
    const auto json = nlohmann::json::parse(out_);
    EXPECT_EQ(json["determined"], false);
    EXPECT_TRUE(json["condition"].is_null());
    EXPECT_EQ(run("point --poses " + path("not_there.csv")), 1);
    EXPECT_NE(err_.find("not_there.csv"), std::string::npos);
    EXPECT_EQ(run("point"), 2);
    EXPECT_EQ(run("pointt --poses a"), 2);
}

TEST_F(CalibrateVerb, DirectionGivesAFrameOnTheTip) {
    Random random(3);
    for (const auto& [name, way] :
         {std::pair{"depth.csv", Vector3{0, 0, 1}}, {"lateral.csv", {1, 0.02, 0.01}}}) {
        std::vector<Pose> poses;
        for (int i = 0; i < 60; ++i) {
            Pose p;
            p.ok = true;
            p.frame = i;
            p.tracker_from_tool.translation = 1.5 * i * way;
            poses.push_back(p);
        }
        save(name, poses);
    }
    PivotMotion motion;
    save("poses.csv", pivot_recording(motion, random));
    ASSERT_EQ(run("point --poses " + path("poses.csv") + " -o " + path("point.json")), 0) << err_;
    ASSERT_EQ(run("direction --poses " + path("depth.csv") + " " + path("lateral.csv") +
                  " --point " + path("point.json") + " -o " + path("probe.json") + " --json"),
              0)
        << err_;
    EXPECT_NEAR(nlohmann::json::parse(out_)["raw_angle_deg"].get<double>(), 89.427, 0.01);
    const auto saved = load_calibration(path("probe.json"));
    ASSERT_TRUE(saved);
    EXPECT_LT(orthonormality_error(saved->sensor_from_tool.rotation), 1e-12);
    EXPECT_NEAR(saved->sensor_from_tool.translation.z, motion.tip_mm.z, 1e-6);
}

TEST_F(CalibrateVerb, NeedleMannequinAndLag) {
    Random random(4);
    std::string files;
    for (int k = 0; k < 5; ++k) {
        PivotMotion motion;
        motion.tip_mm = {0, 0, 150.0 - 20 * k};
        motion.noise_mm = 0.1;
        save("d" + std::to_string(k) + ".csv", pivot_recording(motion, random));
        files += " " + path("d" + std::to_string(k) + ".csv");
    }
    ASSERT_EQ(
        run("needle --poses" + files + " --depths 0,20,40,60,80 --json -o " + path("needle.json")),
        0)
        << err_;
    EXPECT_NEAR(nlohmann::json::parse(out_)["direction"][2].get<double>(), 1, 1e-4);
    EXPECT_NEAR(load_calibration(path("needle.json"))->sensor_from_tool.translation.z, 150, 0.3);

    std::ofstream(path("known.csv")) << "name,x,y,z\na,0,0,0\nb,100,0,0\nc,0,200,0\nd,0,0,50\n";
    std::ofstream(path("touched.csv"))
        << "name,x,y,z\nb,10,100,5\na,10,0,5\nd,10,0,55\nc,-190,0,5\n";
    ASSERT_EQ(run("mannequin --landmarks " + path("known.csv") + " --touched " +
                  path("touched.csv") + " --json -o " + path("mannequin.json")),
              0)
        << err_;
    EXPECT_LT(nlohmann::json::parse(out_)["rms_mm"].get<double>(), 1e-9);
    EXPECT_EQ(load_calibration(path("mannequin.json"))->kind, "mannequin");

    std::vector<Pose> first, second;
    for (int i = 0; i < 600; ++i) {
        Pose p;
        p.ok = true;
        const double t = i / 60.0;
        p.tracker_from_tool.translation = {20 * std::sin(2.1 * t) + 9 * std::sin(4.9 * t), 0, 0};
        p.timestamp_s = t;
        first.push_back(p);
        p.timestamp_s = t + 0.05;
        second.push_back(p);
    }
    save("first.csv", first);
    save("second.csv", second);
    ASSERT_EQ(run("lag --poses " + path("first.csv") + " " + path("second.csv") + " --json"), 0)
        << err_;
    EXPECT_NEAR(nlohmann::json::parse(out_)["lag_s"].get<double>(), 0.05, 0.002);
}

}  // namespace
}  // namespace sonocase::pipeline
