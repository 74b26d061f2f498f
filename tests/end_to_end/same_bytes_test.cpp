// SPDX-License-Identifier: Apache-2.0

// The bytes of four bundles and of sixty frames of each image model, as they were when the digests
// were written down: what is not meant to change the product does not change it. A change that is
// meant to writes its new digests here (a failing test prints them) and says why in its commit.
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include "formats/base/digest.h"
#include "formats/files/atomic_file.h"
#include "support/cooked_case.h"
#include "support/paths.h"
#include "support/run_command.h"
#include "support/temporary_folder.h"

namespace sonocase {
namespace {

namespace fs = std::filesystem;

using sonocase::testing::cooked_scenario;
using sonocase::testing::read_text;
using sonocase::testing::run_command;

// Bundles: since their fit says whether the sweep moved. Physical frames: since the
// opening gain goes by the exercise's organ. Paper frames: of these bundles and of scripts that
// keep clear of ribs.
constexpr const char* kDraft = "e21e6f4316c27e10d563573b9c596da1";
constexpr const char* kBalanced = "e816193b729c254533686bdbfd4d420f";
constexpr const char* kSlender = "6066f95adf71c6206973587949e37baf";
constexpr const char* kReal = "baa49dc536db7c8981dabbb36f78700d";
constexpr const char* kDraftPhysical = "acca27b34d2f1d055af23bcc21d9e73e";
constexpr const char* kDraftPaper = "1aaccd9bf66881ec2231c9c0ceb219e6";
constexpr const char* kRealPhysical = "a93b9816dc9e5cb9a036596e130601f0";
constexpr const char* kRealPaper = "171f0dd55595047b8aebbc8803a1aecb";

class SameBytes : public ::testing::Test {
  protected:
    std::string cook(const std::string& arguments, int threads) {
        const std::string bundle = folder_ / "case.sonocase";
        const auto built =
            run_command(SONOCASE_BIN "/sonocase build " + arguments + " --quiet --threads " +
                        std::to_string(threads) + " -o " + bundle);
        EXPECT_EQ(built.status, 0) << built.error;
        return bundle;
    }

    // Of the names and bytes of sixty frames of the sweep with the needle.
    std::string frames_digest(const std::string& bundle, const std::string& model, int threads) {
        const std::string out = folder_ / "frames";
        fs::remove_all(out);
        const auto played =
            run_command(SONOCASE_BIN "/sonoplay " + bundle +
                        " --headless --exercise liver-biopsy --tracker sweep:needle --frames 60"
                        " --size 512x512 --model " +
                        model + " --threads " + std::to_string(threads) + " --out " + out);
        EXPECT_EQ(played.status, 0) << played.error;
        std::vector<std::string> names;
        for (const auto& entry : fs::directory_iterator(out)) {
            const std::string name = entry.path().filename().string();
            if (name.rfind("frame_", 0) == 0) names.push_back(name);
        }
        std::sort(names.begin(), names.end());
        EXPECT_EQ(names.size(), 60u);
        Digest digest;
        for (const std::string& name : names) digest.add(name).add(read_text(out + "/" + name));
        return digest.hex();
    }

    void expect_frames(const std::string& bundle,
                       const char* physical,
                       const char* paper,
                       const std::vector<int>& numbers_of_threads) {
        for (const int threads : numbers_of_threads) {
            EXPECT_EQ(frames_digest(bundle, "physical", threads), physical) << threads;
            EXPECT_EQ(frames_digest(bundle, "paper", threads), paper) << threads;
        }
    }

    sonocase::testing::TemporaryFolder folder_;
};

TEST_F(SameBytes, DemoTorsoDraftAndItsFrames) {
    const std::string recipe = SONOCASE_SOURCE "/scenarios/demo-torso/case.toml --preset draft";
    EXPECT_EQ(*digest_of_file(cook(recipe, 1)), kDraft);
    const std::string bundle = cook(recipe, 2);
    EXPECT_EQ(*digest_of_file(bundle), kDraft);
    expect_frames(bundle, kDraftPhysical, kDraftPaper, {1, 2});
}

// The two that other tests cook as well, of stages that this run of tests cooked.
TEST_F(SameBytes, DemoTorsoBalanced) {
    EXPECT_EQ(*digest_of_file(cooked_scenario("demo-torso/case.toml").path), kBalanced);
}

TEST_F(SameBytes, SlenderTorso) {
    fs::copy(SONOCASE_SOURCE "/scenarios/demo-torso", folder_ / "slender");
    std::string text = read_text(folder_ / "slender/case.toml");
    const std::string section = "\n[analytic]\n", name = "name = \"demo-torso\"";
    ASSERT_NE(text.find(section), std::string::npos);
    ASSERT_NE(text.find(name), std::string::npos);
    text.replace(text.find(section), section.size(), section + "body = \"slender\"\n");
    text.replace(text.find(name), name.size(), "name = \"slender\"");
    folder_.write("slender/case.toml", text);
    EXPECT_EQ(*digest_of_file(cook(folder_ / "slender/case.toml", 2)), kSlender);
}

TEST_F(SameBytes, RealTorsoAndItsFrames) {
    if (!fs::exists(SONOCASE_DATA "/ct/labels.nii.gz")) GTEST_SKIP() << "no " SONOCASE_DATA;
    const std::string bundle = cooked_scenario("real-torso/case.toml").path;
    EXPECT_EQ(*digest_of_file(bundle), kReal);
    expect_frames(bundle, kRealPhysical, kRealPaper, {2});
}

}  // namespace
}  // namespace sonocase
