// SPDX-License-Identifier: Apache-2.0

// The main job as a user does it, with the two programs: cook, inspect, validate, play.
#include <gtest/gtest.h>

#include <cstdio>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "support/paths.h"
#include "support/run_command.h"
#include "support/temporary_folder.h"

namespace sonocase {
namespace {

namespace fs = std::filesystem;

using sonocase::testing::CommandResult;
using sonocase::testing::read_text;

const std::string kSonocase = std::string(SONOCASE_BIN) + "/sonocase";
const std::string kSonoplay = std::string(SONOCASE_BIN) + "/sonoplay";

class Chain : public ::testing::Test {
  protected:
    CommandResult run(const std::string& command) {
        return sonocase::testing::run_command(command);
    }

    // Cooks, inspects, validates and plays a sweep; the checks that hold for any case.
    void cook_and_play(const std::string& build_arguments,
                       const std::string& sweep,
                       std::size_t least_labels) {
        const std::string bundle = folder_ / "case.sonocase";
        const CommandResult build = run(kSonocase + " build " + build_arguments + " -o " + bundle);
        ASSERT_EQ(build.status, 0) << build.error;
        const CommandResult inspect = run(kSonocase + " inspect --json " + bundle);
        ASSERT_EQ(inspect.status, 0) << inspect.error;
        const auto facts = nlohmann::json::parse(inspect.out);
        EXPECT_EQ(facts["grid"]["size"].size(), 3u);
        EXPECT_GE(facts["labels"].size(), least_labels);
        for (const auto& label : facts["labels"]) {
            EXPECT_FALSE(label["tissue"].get<std::string>().empty()) << label.dump();
        }
        EXPECT_GE(facts["stages"].size(), 6u);
        const CommandResult validate = run(kSonocase + " validate " + bundle);
        EXPECT_EQ(validate.status, 0) << validate.error;

        const std::string frames = folder_ / "frames";
        for (const std::string& model : std::vector<std::string>{"paper", "physical"}) {
            const CommandResult play =
                run(kSonoplay + " " + bundle + " --headless --tracker sweep:" + sweep +
                    " --model " + model + " --frames 6 --size 256x256 --out " + frames + "/" +
                    model + " --stats " + (folder_ / "stats.json"));
            ASSERT_EQ(play.status, 0) << play.error;
            EXPECT_EQ(nlohmann::json::parse(read_text(folder_ / "stats.json"))["frames"], 6);
            EXPECT_NE(read_text(frames + "/" + model + "/frame_00000.png"),
                      read_text(frames + "/" + model + "/frame_00002.png"));
        }
    }

    sonocase::testing::TemporaryFolder folder_;
};

TEST_F(Chain, DemoTorsoWithoutAnyFile) {
    cook_and_play("--set resample.voxel_mm=3", "tour", 40);
}

TEST_F(Chain, TheSameInputsGiveTheSameBytesOnOneThreadAndTwo) {
    const std::string common = " build --set resample.voxel_mm=4 --quiet -o ";
    const std::string one = folder_ / "one.sonocase", two = folder_ / "two.sonocase";
    ASSERT_EQ(run(kSonocase + common + one + " --threads 1").status, 0);
    ASSERT_EQ(run(kSonocase + common + two + " --threads 2").status, 0);
    EXPECT_TRUE(read_text(one) == read_text(two));
}

TEST_F(Chain, RealTorsoFromTheSharedData) {
    const std::string data = SONOCASE_DATA;
    if (!fs::exists(data + "/ct/labels.nii.gz")) GTEST_SKIP() << "no " << data;
    cook_and_play(std::string(SONOCASE_SOURCE) + "/scenarios/real-torso/case.toml --data " + data +
                      " --set resample.voxel_mm=2",
                  "tour", 60);
}

TEST_F(Chain, ADamagedBundleIsOneLineAndExitOne) {
    const std::string bundle = folder_ / "case.sonocase";
    ASSERT_EQ(run(kSonocase + " build --set resample.voxel_mm=6 --quiet -o " + bundle).status, 0);
    fs::resize_file(bundle, fs::file_size(bundle) / 2);
    for (const std::string& command : {kSonocase + " inspect ", kSonocase + " validate ",
                                       kSonoplay + " --headless --frames 1 "}) {
        const CommandResult broken = run(command + bundle);
        EXPECT_EQ(broken.status, 1) << command << broken.error;
        EXPECT_NE(broken.error.find("case.sonocase"), std::string::npos) << broken.error;
    }
}

}  // namespace
}  // namespace sonocase
