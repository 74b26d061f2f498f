// SPDX-License-Identifier: Apache-2.0

// The program sonoplay without a window, as a user starts it.
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <nlohmann/json.hpp>

#include "formats/base/constants.h"
#include "formats/bundle/case_bundle.h"
#include "formats/calibration/calibration.h"
#include "formats/files/load_save.h"
#include "formats/recording/poses.h"
#include "support/paths.h"
#include "support/run_command.h"
#include "support/small_case.h"
#include "support/temporary_folder.h"

namespace sonocase::runtime {
namespace {

using sonocase::testing::CommandResult;
using sonocase::testing::read_text;

class Headless : public ::testing::Test {
  protected:
    void SetUp() override {
        bundle_ = folder_ / "cylinder.sonocase";
        const Status saved = save_bundle(sonocase::testing::small_case(), bundle_);
        ASSERT_TRUE(saved) << saved.error().message();
    }
    CommandResult play(const std::string& arguments) {
        // No display and no home: headless needs neither.
        return sonocase::testing::run_command(
            "env -u DISPLAY -u WAYLAND_DISPLAY HOME=/nonexistent " SONOCASE_BIN "/sonoplay " +
            arguments);
    }
    sonocase::testing::TemporaryFolder folder_;
    std::string bundle_;
};

TEST_F(Headless, WritesFramesAndStatsOfASweep) {
    const CommandResult run = play(bundle_ +
                                   " --headless --tracker sweep:along --model paper --frames 12 "
                                   "--size 128x96 --out " +
                                   (folder_ / "frames") + " --stats " + (folder_ / "stats.json"));
    ASSERT_EQ(run.status, 0) << run.error;
    EXPECT_EQ(run.error, "");
    int frames = 0;
    for (const auto& entry : std::filesystem::directory_iterator(folder_ / "frames")) {
        if (entry.path().filename() == "contact-sheet.png") continue;
        if (entry.path().filename() == "pictures.json") {  // what DICOM needs to know of them
            const auto about = nlohmann::json::parse(read_text(entry.path().string()));
            EXPECT_EQ(about["case"], "cylinder");
            EXPECT_GT(about["mm_per_px"].get<double>(), 0.5);  // 100 mm in 96 rows
            EXPECT_EQ(about["picture_height_px"], 96);
            continue;
        }
        EXPECT_EQ(entry.path().extension(), ".png");
        const std::string png = read_text(entry.path().string());
        ASSERT_GT(png.size(), 100u);
        EXPECT_EQ(static_cast<unsigned char>(png[19]), 128);  // IHDR width and height, big-endian
        EXPECT_EQ(static_cast<unsigned char>(png[23]), 96);
        ++frames;
    }
    EXPECT_EQ(frames, 12);
    EXPECT_NE(read_text(folder_ / "frames/frame_00000.png"),
              read_text(folder_ / "frames/frame_00011.png"));
    const auto stats = nlohmann::json::parse(read_text(folder_ / "stats.json"));
    EXPECT_EQ(stats["frames"], 12);
    EXPECT_GT(stats["frame_ms"]["median"].get<double>(), 0);
    EXPECT_GE(stats["frame_ms"]["p99"].get<double>(), stats["frame_ms"]["median"].get<double>());
    EXPECT_GT(stats["first_frame_ms"].get<double>(), 0);
    EXPECT_GT(stats["resident_mb"].get<double>(), 1);
    ASSERT_FALSE(stats["effects"].empty());
    for (const auto& effect : stats["effects"]) {
        EXPECT_FALSE(effect["name"].get<std::string>().empty());
        EXPECT_GE(effect["ms"].get<double>(), 0);
        EXPECT_LE(effect["skipped_frames"].get<int>(), 12);
    }
}

TEST_F(Headless, MeasuresWhatEffectsCostAndChange) {
    const std::string command = bundle_ +
                                " --headless --tracker sweep:along --model paper --frames 3 "
                                "--effects=-shadow --size 128x96 --stats " +
                                (folder_ / "stats.json");
    const auto effects = [&](const std::string& more) {
        const CommandResult run = play(command + more);
        EXPECT_EQ(run.status, 0) << run.error;
        return nlohmann::json::parse(read_text(folder_ / "stats.json"));
    };
    const auto named = [](const nlohmann::json& stats, const std::string& name) {
        for (const auto& effect : stats["effects"])
            if (effect["name"] == name) return effect;
        return nlohmann::json();
    };
    const auto plain = effects(""), measured = effects(" --measure-effects");
    EXPECT_EQ(named(plain, "noise")["cost"], "estimated");
    EXPECT_FALSE(plain.contains("effects_measured"));
    EXPECT_EQ(measured["effects_measured"]["frames"], 3);
    EXPECT_GT(measured["effects_measured"]["frame_ms"].get<double>(), 0);
    EXPECT_EQ(named(measured, "noise")["cost"], "measured");
    // Noise of a deviation of 15 grey where the picture is not black, less what the blur takes.
    EXPECT_GT(named(measured, "noise")["changed_part"].get<double>(), 0.3);
    EXPECT_GT(named(measured, "noise")["rms_grey"].get<double>(), 1);
    EXPECT_LT(named(measured, "noise")["rms_grey"].get<double>(), 15);
    EXPECT_EQ(named(measured, "noise")["why"], "on in 3 of 3 frames: part of every picture");
    // What cannot be left out, and what did not run, keeps its estimate and says why.
    EXPECT_EQ(named(measured, "slice")["cost"], "estimated");
    EXPECT_EQ(named(measured, "shadow")["cost"], "estimated");
    EXPECT_EQ(named(measured, "shadow")["why"], "skipped: switched off");
}

TEST_F(Headless, GivesTheSameBytesTwiceAndOnTwoThreads) {
    for (const char* name : {"a", "b", "c"}) {
        const std::string threads = name[0] == 'c' ? " --threads 2" : "";
        const CommandResult run =
            play(bundle_ + " --headless --model paper --frames 3 --size 96x96" + threads +
                 " --out " + (folder_ / name));
        ASSERT_EQ(run.status, 0) << run.error;
    }
    for (const char* frame : {"/frame_00000.png", "/frame_00002.png"}) {
        EXPECT_EQ(read_text(folder_ / "a" + frame), read_text(folder_ / "b" + frame));
        EXPECT_EQ(read_text(folder_ / "a" + frame), read_text(folder_ / "c" + frame));
    }
}

TEST_F(Headless, WarnsOfAnOldAndPoorCalibrationAndGoesOn) {
    Calibration probe;
    probe.kind = "probe";
    probe.rms_mm = 25;
    probe.date = "2001-02-03T04:05:06Z";
    ASSERT_TRUE(save_calibration(probe, folder_ / "old.json"));
    const CommandResult run = play(
        bundle_ + " --headless --tracker null --frames 1 --calibration " + (folder_ / "old.json"));
    EXPECT_EQ(run.status, 0) << run.error;
    EXPECT_NE(run.error.find("Calibration of the probe"), std::string::npos) << run.error;
}

TEST_F(Headless, ReplaysEveryRowInOrderAndAppliesCalibrations) {
    // The same path twice: once in `mannequin`, once as a tracker elsewhere sees it with a sensor
    // mounted beside the probe. With calibrations, the pictures are the same.
    const Rigid world_from_mannequin{rotation_about({0, 0, 1}, 0.7), {100, 20, -30}};
    const Rigid sensor_from_probe{rotation_about({1, 0, 0}, -0.4), {3, 8, 40}};
    const double scale = 1.03;
    std::vector<Pose> bare, seen;
    for (int i = 0; i < 5; ++i) {
        Pose pose;
        pose.frame = i;
        pose.timestamp_s = 100 + i / 20.0;
        pose.ok = true;
        pose.tracker_from_tool = {rotation_about({1, 0, 0}, kPi), {0, -20.0 + 10 * i, 59}};
        bare.push_back(pose);
        Rigid scaled = pose.tracker_from_tool;
        scaled.translation = scale * scaled.translation;
        pose.tracker_from_tool = world_from_mannequin * scaled * inverse(sensor_from_probe);
        seen.push_back(pose);
    }
    folder_.write("bare.csv", format_poses(bare));
    folder_.write("seen.csv", format_poses(seen));
    Calibration probe, mannequin;
    probe.kind = "probe";
    probe.sensor_from_tool = sensor_from_probe;
    mannequin.kind = "mannequin";
    mannequin.sensor_from_tool = world_from_mannequin;
    mannequin.scale = scale;
    ASSERT_TRUE(save_calibration(probe, folder_ / "probe.json"));
    ASSERT_TRUE(save_calibration(mannequin, folder_ / "mannequin.json"));
    const std::string common = bundle_ + " --headless --model paper --size 96x96 --stats - ";
    const CommandResult a =
        play(common + "--tracker replay:" + (folder_ / "bare.csv") + " --out " + (folder_ / "a"));
    const CommandResult b = play(common + "--tracker replay:" + (folder_ / "seen.csv") + " --out " +
                                 (folder_ / "b") + " --calibration " + (folder_ / "probe.json") +
                                 " --calibration " + (folder_ / "mannequin.json"));
    ASSERT_EQ(a.status, 0) << a.error;
    ASSERT_EQ(b.status, 0) << b.error;
    EXPECT_EQ(nlohmann::json::parse(a.out)["frames"], 5);
    EXPECT_NE(read_text(folder_ / "a/frame_00000.png"), read_text(folder_ / "a/frame_00004.png"));
    // CSV keeps nine digits of rotation, so that a few pixels may fall into the next voxel: the
    // files are compared by size, and the first one by most of its bytes.
    for (const char* frame : {"/frame_00000.png", "/frame_00004.png"}) {
        EXPECT_NEAR(double(read_text(folder_ / "a" + frame).size()),
                    double(read_text(folder_ / "b" + frame).size()), 100);
    }
}

TEST_F(Headless, RecordsASessionAndScoresIt) {
    const std::string record = folder_ / "session.igs.mha";
    const CommandResult run =
        play(bundle_ + " --headless --model paper --size 96x96 --frames 60 --stats - --record " +
             record);
    ASSERT_EQ(run.status, 0) << run.error;
    const auto stats = nlohmann::json::parse(run.out);
    ASSERT_TRUE(stats.contains("metrics")) << run.out;
    // The script pushes the needle in once.
    ASSERT_TRUE(stats["insertions"].is_array());
    EXPECT_EQ(stats["insertions"].size(), 1u);
    EXPECT_EQ(read_text(record).substr(0, 18), "ObjectType = Image");
    // The recording replays with probe and needle at the same places: the same pictures.
    const CommandResult first =
        play(bundle_ + " --headless --model paper --size 96x96 --frames 60 --out " +
             (folder_ / "first"));
    const CommandResult again =
        play(bundle_ + " --headless --model paper --size 96x96 --tracker replay:" + record +
             " --out " + (folder_ / "again"));
    ASSERT_EQ(first.status, 0) << first.error;
    ASSERT_EQ(again.status, 0) << again.error;
    EXPECT_EQ(read_text(folder_ / "first/frame_00030.png"),
              read_text(folder_ / "again/frame_00030.png"));
}

TEST_F(Headless, AnExerciseFromAFileIsPlayedDrawnAndReplayedFromItsSeed) {
    std::string toml = sonocase::testing::small_exercise_toml();
    toml.replace(toml.find("hit_radius_mm = 6"), 17, "hit_radius_mm = 6\nspread_mm = 20");
    toml.replace(toml.find("name = \"scan\""), 13, "name = \"mine\"");
    folder_.write("mine.toml", toml);
    const std::string file = folder_ / "mine.toml";
    const auto run = [&](const std::string& tracker, const std::string& more) {
        const CommandResult done = play(bundle_ + " --headless --exercise " + file + " --tracker " +
                                        tracker + " --size 64x64 --model paper " + more);
        EXPECT_EQ(done.status, 0) << done.error;
        return done;
    };
    run("sweep:along", "--frames 20 --attempt-seed 7 --record " + (folder_ / "a.igs.mha") +
                           " --stats " + (folder_ / "a.json"));
    EXPECT_NE(read_text(folder_ / "a.igs.mha").find("SonocaseAttempt = seed=7"), std::string::npos);
    run("replay:" + (folder_ / "a.igs.mha"), "--record " + (folder_ / "b.igs.mha"));
    EXPECT_NE(read_text(folder_ / "b.igs.mha").find("SonocaseAttempt = seed=7"), std::string::npos);
    run("sweep:along", "--frames 2 --record " + (folder_ / "c.igs.mha"));
    EXPECT_EQ(read_text(folder_ / "c.igs.mha").find("SonocaseAttempt"), std::string::npos);

    toml.replace(toml.find("centre = [0, 0, 25]"), 19, "centre = [0, 0, 99]");
    folder_.write("outside.toml", toml);
    folder_.write("wrong.toml", "name = 3\n");
    for (const char* name : {"outside.toml", "wrong.toml", "absent.toml"}) {
        const CommandResult wrong = play(bundle_ + " --headless --exercise " + (folder_ / name));
        EXPECT_EQ(wrong.status, 1);
        EXPECT_NE(wrong.error.find(name), std::string::npos) << wrong.error;
        EXPECT_EQ(std::count(wrong.error.begin(), wrong.error.end(), '\n'), 1) << wrong.error;
    }
}

TEST_F(Headless, SaysInOneLineWhatIsWrong) {
    struct Case {
        std::string arguments;
        int status;
        std::string says;
    };
    folder_.write("damaged.sonocase", read_text(bundle_).substr(0, 2000));
    folder_.write("empty.csv", "");
    const std::vector<Case> cases = {
        {"--headless", 1, "no bundle"},
        {(folder_ / "absent.sonocase") + " --headless", 1, "absent.sonocase"},
        {(folder_ / "damaged.sonocase") + " --headless", 1, "damaged.sonocase"},
        {bundle_ + " --headless --exercise liver", 1, "scan"},
        {bundle_ + " --headless --tracker sweep:round", 1, "along"},
        {bundle_ + " --headless --tracker magic", 1, "mouse"},
        {bundle_ + " --headless --tracker replay:" + (folder_ / "empty.csv"), 1, "empty.csv"},
        {bundle_ + " --headless --tracker replay:/nonexistent.csv", 1, "/nonexistent.csv"},
        {bundle_ + " --headless --calibration /nonexistent.json", 1, "/nonexistent.json"},
        {bundle_ + " --headless --model paper --effects glitter", 1, "glitter"},
        {bundle_ + " --headless --model paper --out /proc/nothing", 1, "/proc/nothing"},
        {bundle_ + " --headless --model paper --stats /proc/nothing.json", 1, "/proc/nothing.json"},
        {bundle_ + " --headless --model paper --record /proc/nothing.igs.mha", 1,
         "/proc/nothing.igs.mha"},
        {bundle_ + " --headless --record x.mp4", 2, "--record x.mp4 does not end in .mha"},
        {bundle_ + " --headless --trainee Ada", 2, "use it with --record"},
        {bundle_ + " --headless --size huge", 2, "WxH"},
        {bundle_ + " --headless --model cubist", 2, "physical"},
        {bundle_ + " --headless --frames 0", 2, "frames"},
        {bundle_ + " --headless --unknown", 2, "--unknown"},
    };
    for (const Case& c : cases) {
        const CommandResult run = play(c.arguments);
        EXPECT_EQ(run.status, c.status) << c.arguments << "\n" << run.error;
        EXPECT_NE(run.error.find(c.says), std::string::npos) << c.arguments << "\n" << run.error;
        EXPECT_EQ(std::count(run.error.begin(), run.error.end(), '\n'), 1) << c.arguments << "\n"
                                                                           << run.error;
    }
}

TEST_F(Headless, DoesNotRecordOverWhatItReplays) {
    const std::string file = folder_ / "a.igs.mha", link = folder_ / "link.igs.mha";
    const std::string run = bundle_ + " --headless --model paper --size 64x64 --tracker ";
    ASSERT_EQ(play(run + "sweep:along --frames 5 --record " + file).status, 0);
    const std::string before = read_text(file);
    std::filesystem::create_symlink(file, link);
    std::filesystem::copy_file(file, folder_ / "b.igs.mha");
    for (const std::string& tracker :
         {file, link, folder_.path() + "/./a.igs.mha", (folder_ / "b.igs.mha") + "," + file}) {
        const CommandResult refused = play(run + "replay:" + tracker + " --record " + file);
        EXPECT_EQ(refused.status, 2) << tracker;
        EXPECT_NE(refused.error.find("a.igs.mha is the file that --tracker replays"),
                  std::string::npos)
            << refused.error;
        EXPECT_EQ(read_text(file), before) << tracker;
    }
    EXPECT_EQ(play(run + "replay:" + file + " --record " + (folder_ / "b.igs.mha")).status, 0);
}

TEST(PlayerProgram, LinksNoLibraryOfThePipeline) {
    const CommandResult run = sonocase::testing::run_command("ldd " SONOCASE_BIN "/sonoplay");
    ASSERT_EQ(run.status, 0) << run.error;
    ASSERT_NE(run.out.find("libc.so"), std::string::npos);
    for (const char* name :
         {"ITK", "itk", "vtk", "openvdb", "ceres", "OpenImageIO", "tbb", "glog"}) {
        EXPECT_EQ(run.out.find(std::string("lib") + name), std::string::npos) << name << "\n"
                                                                              << run.out;
    }
}

}  // namespace
}  // namespace sonocase::runtime
