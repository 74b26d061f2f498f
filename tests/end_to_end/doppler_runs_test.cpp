// SPDX-License-Identifier: Apache-2.0

// Doppler modes from a recipe to a score: vessels of a real torso, the exercises about them, and
// sessions that replay to the same bytes.
#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>
#include <filesystem>

#include "formats/base/constants.h"
#include "formats/bundle/case_bundle.h"
#include "formats/files/load_save.h"
#include "formats/flow/flow_summary.h"
#include "runtime/imaging/doppler/colour_image.h"
#include "runtime/imaging/doppler_cases.h"
#include "support/cooked_case.h"
#include "support/hard_case.h"
#include "support/paths.h"
#include "support/run_command.h"
#include "support/small_case.h"

namespace sonocase {
namespace {

namespace fs = std::filesystem;
using runtime::doppler::ColourCell;
using runtime::doppler::ColourImage;
using runtime::doppler::FlowScene;
using testing::HardCase;
using testing::run_command;
using testing::TemporaryFolder;

std::string player(const std::string& arguments) {
    const auto run = run_command(std::string(SONOCASE_BIN) + "/sonoplay " + arguments);
    EXPECT_EQ(run.status, 0) << arguments << "\n" << run.error;
    return run.out;
}

// One frame after another of a linear probe that looks at the middle of a vessel, at 65 degrees to
// its flow: a probe across it that is tilted by 25 degrees.
class Look {
  public:
    Look(const FlowField& field, const FlowVessel& vessel, int index)
        : index_(index),
          scene_(field, kBeatS),
          geometry_(runtime::make_scan_geometry(
              runtime::doppler::testing::linear_probe(), 192, 512, 128, 128)),
          image_(scene_, geometry_, 5, 30) {
        const FlowNode& node =
            field.nodes[static_cast<std::size_t>(vessel.first_node + vessel.nodes / 2)];
        const Vector3 side = any_perpendicular(node.direction), front = cross(node.direction, side),
                      beam = std::cos(65 * kPi / 180) * node.direction +
                             std::sin(65 * kPi / 180) * front;
        tissue_.pose = {Matrix3::from_columns(side, cross(beam, side), beam),
                        node.centre - 30.0 * beam - Point3{}};
        settings_.mode = runtime::DopplerMode::colour;
        settings_.box_left = 0;
        settings_.box_right = 1;
        settings_.box_top_mm = 10;
        settings_.box_bottom_mm = 50;
        settings_.scale_cm_s = 60;
        settings_.wall_filter = 0.05;
        grey_.assign(128 * 128, 20);
        overlay_.resize(grey_.size());
    }

    // The rule. From twelve frames of a beat: velocity shown, mean over the vessel's cells; an
    // artery's changes by more than 1.5 times its size.
    bool artery() {
        double least = 1e9, most = -1e9, size = 0;
        for (std::uint32_t frame = 0; frame < 12; ++frame) {
            image_.render(settings_, {frame / 12.0, 0.5, frame, 1}, tissue_, grey_, overlay_);
            const double mean = mean_shown();
            least = std::min(least, mean);
            most = std::max(most, mean);
            size += std::abs(mean) / 12;
        }
        return (most - least) / size > 1.5;
    }
    int cells() const { return cells_; }

  private:
    static constexpr double kBeatS = 60.0 / 70;
    double mean_shown() {
        double sum = 0;
        cells_ = 0;
        for (int row = 0; row < image_.box().rows; ++row)
            for (int line = 0; line < image_.box().lines; ++line) {
                const ColourCell cell = image_.cell(line, row);
                if (!cell.blood || cell.vessel != index_) continue;
                ++cells_;
                if (cell.shown) sum += static_cast<double>(cell.turns);
            }
        return sum / std::max(cells_, 1);
    }
    int index_, cells_ = 0;
    FlowScene scene_;
    runtime::ScanGeometry geometry_;
    ColourImage image_;
    runtime::doppler::testing::StillTissue tissue_;
    runtime::DopplerSettings settings_;
    std::vector<std::uint8_t> grey_, overlay_;
};

const VesselSummary* summary_of(const std::vector<VesselSummary>& all, const std::string& name) {
    for (const VesselSummary& one : all)
        if (one.name == name) return &one;
    ADD_FAILURE() << "no vessel " << name;
    return nullptr;
}

// The greatest velocities of docs/flow.md's table, mean and two deviations where they are known.
void expect_normal(const FlowField& field) {
    const auto all = vessel_summaries(field, 60.0 / 70);
    struct Row {
        const char* name;
        double low, high;  // cm/s
    };
    for (const Row& row :
         {Row{"aorta", 40, 140}, Row{"aorta 3", 40, 140}, Row{"iliac_artery_right", 70, 163},
          Row{"iliac_artery_left", 70, 163}, Row{"iliac_artery_right 2", 75, 163},
          Row{"iliac_artery_left 2", 75, 163}, Row{"iliac_vena_right 2", 9, 30},
          Row{"iliac_vena_left 2", 9, 30}, Row{"portal_vein_and_splenic_vein 3", 16, 20}}) {
        const VesselSummary* vessel = summary_of(all, row.name);
        if (vessel == nullptr) continue;
        EXPECT_GE(vessel->peak_cm_s, row.low) << row.name;
        EXPECT_LE(vessel->peak_cm_s, row.high) << row.name;
    }
    // Flow where velocities are not published: cava below the renal veins, portal vein; mL/min.
    for (const Row& row : {Row{"inferior_vena_cava 2", 200, 2200}, Row{"aorta 3", 100, 1740},
                           Row{"portal_vein_and_splenic_vein 3", 488, 1240}}) {
        const VesselSummary* vessel = summary_of(all, row.name);
        if (vessel == nullptr) continue;
        EXPECT_GE(vessel->mean_ml_min, row.low) << row.name;
        EXPECT_LE(vessel->mean_ml_min, row.high) << row.name;
    }
    EXPECT_LT(worst_balance(field), 0.05);
}

void expect_told_apart(const FlowField& field) {
    int right = 0;
    for (std::size_t v = 0; v < field.vessels.size(); ++v) {
        const FlowVessel& vessel = field.vessels[v];
        if (vessel.nodes == 0 || vessel.name.rfind("iliac", 0) != 0) continue;
        Look look(field, vessel, static_cast<int>(v));
        const bool artery = look.artery();
        EXPECT_EQ(artery, vessel.kind == FlowKind::artery) << vessel.name;
        EXPECT_GT(look.cells(), 20) << vessel.name;
        right += artery == (vessel.kind == FlowKind::artery);
    }
    std::printf("%d iliac and femoral vessels told apart\n", right);
    EXPECT_GE(right, 8);
}

// True where the run's marks are all met.
bool passes(const std::string& bundle,
            const std::string& exercise,
            const std::string& arguments,
            const std::string& recording,
            int frames = 180) {
    const std::string out =
        player(bundle + " --headless --exercise " + exercise + " --size 128x128 --record " +
               recording + " --stats - --frames " + std::to_string(frames) + " " + arguments);
    const bool passed = out.find("\"passed\": true,\n") != std::string::npos &&
                        out.find("\"passed\": false") == std::string::npos;
    std::printf("%s %s: %s\n", exercise.c_str(), arguments.c_str(), passed ? "passed" : "failed");
    if (!passed) std::printf("%s\n", out.substr(out.find("pass_marks"), 900).c_str());
    return passed;
}

TEST(DopplerRuns, VesselsOfTheRealTorsoAndTheirExercises) {
    const std::string data = SONOCASE_DATA;
    if (!fs::exists(data + "/ct/labels.nii.gz")) GTEST_SKIP() << "no " << data;
    const TemporaryFolder folder;
    const std::string path =
        testing::cooked_scenario("vessels/case.toml", "--set resample.voxel_mm=1.5").path;
    const auto bundle = load_bundle(path);
    ASSERT_TRUE(bundle) << bundle.error().message();
    expect_normal(bundle->flow);
    expect_told_apart(bundle->flow);

    const std::string recording = folder / "session.igs.mha";
    const std::string find = "find-vessels", measure = "artery-velocity";
    EXPECT_TRUE(passes(path, find, "--tracker sweep:tilted --mode colour", recording));
    EXPECT_FALSE(passes(path, find, "--tracker sweep:upright --mode colour", recording));
    EXPECT_FALSE(passes(path, find, "--tracker sweep:tilted", recording));
    // The gate in the artery, and the cursor along it; then off it; then in the vein beside it.
    const std::string gate =
        "--tracker sweep:tilted --mode pw --steer 0 --spectral-scale 120 --gate ";
    const std::string artery = "0.41,26,4", vein = "0.565,32,4";
    EXPECT_TRUE(passes(path, measure, gate + artery + " --angle 53", recording));
    EXPECT_FALSE(passes(path, measure, gate + artery + " --angle 20", recording));
    EXPECT_FALSE(passes(path, measure, gate + vein + " --angle 53", recording));
    // Colour first, then the needle: all of it, and the needle without having looked.
    const std::string access = "femoral-access-doppler";
    EXPECT_TRUE(
        passes(path, access, "--tracker sweep:procedure --mode colour", recording, 30 * 21));
    EXPECT_FALSE(passes(path, access, "--tracker sweep:needle", recording, 30 * 15));
}

// 300 mL/min in straight tubes of an even material: parabolas, whose peak is twice the mean.
TEST(DopplerRuns, TheFlowPhantomMeasuresWhatIsPumpedThroughIt) {
    const TemporaryFolder folder;
    const std::string path = testing::cooked_scenario("flow-phantom").path;
    const auto bundle = load_bundle(path);
    ASSERT_TRUE(bundle) << bundle.error().message();
    const auto all = vessel_summaries(bundle->flow, 1);
    HardCase wide("diameter of a tube of known flow, off", HardCase::at_most, 0.1, "mm");
    HardCase fast("its peak velocity, off", HardCase::at_most, 0.02, "");
    for (const int diameter : {4, 6, 8, 12}) {
        const VesselSummary* tube =
            summary_of(all, "phantom_tube_" + std::to_string(diameter) + "mm");
        if (tube == nullptr) continue;
        const double peak = 2 * 5 / (kPi * diameter * diameter / 400);  // cm/s
        EXPECT_NEAR(tube->mean_ml_min, 300, 0.1);
        wide.see(std::abs(tube->diameter_mm - diameter));  // voxels are of 1 mm
        fast.see(std::abs(tube->peak_cm_s / peak - 1));
        const std::string exercise = "tube-" + std::to_string(diameter) + "mm";
        EXPECT_TRUE(
            passes(path, exercise,
                   "--tracker sweep:along --mode pw --spectral-scale " + std::to_string(1.2 * peak),
                   folder / "session.igs.mha", 200));
    }
    // In the throat; aimed by itself the gate stands where the vessel is widest, before it.
    const std::string throat =
        "--tracker sweep:along --mode pw --steer 0 --gate 0.5,30,3 --angle 50 --spectral-scale 50";
    EXPECT_TRUE(passes(path, "stenosis", throat, folder / "session.igs.mha", 200));
}

// A small case with a vessel that flows, on the disk.
std::string flowing_case(const TemporaryFolder& folder) {
    CaseBundle bundle = testing::small_case();
    testing::add_flow(bundle);
    const auto bytes = write_bundle(bundle);
    return folder.write("flowing.sonocase",
                        {reinterpret_cast<const char*>(bytes.data()), bytes.size()});
}

TEST(DopplerRuns, RecordedSessionsReplayToTheSameBytes) {
    const TemporaryFolder folder;
    const std::string bundle = flowing_case(folder),
                      common = bundle + " --headless --model physical --size 96x96 ";
    for (const char* mode : {"colour", "pw"}) {
        const std::string record = folder / (std::string(mode) + ".igs.mha"),
                          first = folder / (std::string(mode) + "-first"),
                          again = folder / (std::string(mode) + "-again");
        player(common + "--tracker sweep:along --frames 40 --mode " + mode + " --record " + record +
               " --out " + first);
        player(common + "--tracker replay:" + record + " --out " + again);
        int pictures = 0, coloured = 0;
        for (const auto& entry : fs::directory_iterator(first)) {
            const std::string name = entry.path().filename().string();
            if (name.rfind("frame_", 0) != 0) continue;
            const std::string bytes = testing::read_text(entry.path().string());
            EXPECT_EQ(bytes, testing::read_text(again + "/" + name)) << mode << " " << name;
            ++pictures;
            // Type 2 in the header of a PNG: in colour.
            coloured += bytes.size() > 25 && bytes[25] == 2;
        }
        EXPECT_EQ(pictures, 40);
        EXPECT_EQ(coloured, 40);
    }
}

}  // namespace
}  // namespace sonocase
