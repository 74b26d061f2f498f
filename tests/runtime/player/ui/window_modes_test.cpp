// SPDX-License-Identifier: Apache-2.0

// The image modes of the window, and the names of what it shows.
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>

#include "formats/files/load_save.h"
#include "formats/recording/session.h"
#include "runtime/player/ui/window_picture.h"
#include "support/flowing_case.h"
#include "window_run.h"

namespace sonocase::runtime {
namespace {

using sonocase::testing::CommandResult;
using sonocase::testing::load_picture;
using sonocase::testing::Picture;
using sonocase::testing::read_text;

class WindowModes : public sonocase::testing::WindowRun {
  protected:
    WindowModes() : WindowRun(sonocase::testing::flowing_case(), "tube.sonocase") {
        // Without a sound device the player would say so on standard error.
        folder_.write("config/sonocase/player.json", R"({"sound": false})");
    }
    CommandResult run(const std::string& arguments, const std::string& script) {
        return in_display(command(arguments, script));
    }
    std::string picture_box(const std::string& name) {
        const std::string boxes = read_text(folder_ / (name + ".png.boxes"));
        const std::size_t end = boxes.find(" picture\n");
        if (end == std::string::npos) return "no picture in " + name;
        const std::size_t begin = boxes.rfind('\n', end) + 1;
        return boxes.substr(begin, end - begin);
    }
};

// Pixels of the picture's area that are no grey.
int coloured(const Picture& picture) {
    int count = 0;
    for (int y = 60; y < 640; ++y) {
        for (int x = 300; x < 970; ++x) {
            const std::uint8_t* p = &picture.rgb[3 * (static_cast<std::size_t>(y) * 1280 + x)];
            const int high = std::max({p[0], p[1], p[2]}), low = std::min({p[0], p[1], p[2]});
            count += high > 40 && high - low > 0.15 * high;
        }
    }
    return count;
}

TEST_F(WindowModes, ColourSpectrumAndMotionAreShownAndRecorded) {
    const CommandResult result = run(
        "--model paper --record " + (folder_ / "session.igs.mha"),
        "wait 4\nhold e 118\nwait 4\n" + shot("grey") + "key 2 shift\nwait 40\n" + shot("colour") +
            "key 3 shift\nwait 150\n" + shot("spectrum") + "key 4 shift\nwait 60\n" +
            shot("motion") + "key 1 shift\nwait 8\n" + shot("again") + "quit\n");
    ASSERT_EQ(result.status, 0) << result.error;
    EXPECT_EQ(result.error, "");
    const auto picture = [&](const char* name) { return load_picture(folder_ / name + ".png"); };
    ASSERT_EQ(picture("colour").width, 1280);
    EXPECT_EQ(coloured(picture("grey")), 0);
    EXPECT_EQ(coloured(picture("again")), 0);
    // The bar beside it alone has some 1000.
    EXPECT_GT(coloured(picture("colour")), 3000);
    EXPECT_EQ(coloured(picture("spectrum")), 0);
    // The strip is in the lower third of the picture's area, which stays where it is.
    EXPECT_GT(picture("spectrum").mean(320, 460, 880, 600), 2);
    EXPECT_GT(picture("motion").mean(600, 460, 880, 600), 8);
    for (const char* name : {"colour", "spectrum", "motion", "again"})
        EXPECT_EQ(picture_box(name), picture_box("grey")) << name;
    EXPECT_TRUE(says("spectrum", "PSV")) << read_text(folder_ / "spectrum.png.boxes");
    EXPECT_TRUE(says("spectrum", " gate\n"));
    EXPECT_FALSE(says("grey", " filter\n"));
    // Recorded as any setting, so that a replay without a window shows it.
    const auto sequence = load_sequence(folder_ / "session.igs.mha");
    ASSERT_TRUE(sequence);
    const auto session =
        session_from_sequence(*sequence, guess_names(*sequence), folder_ / "session.igs.mha");
    ASSERT_TRUE(session);
    std::string settings;
    for (const SessionSample& sample : session->samples) settings += sample.settings + "\n";
    for (const char* mode : {"doppler=colour", "doppler=spectral", "doppler=m_mode"})
        EXPECT_NE(settings.find(mode), std::string::npos) << mode;
}

// A replay shows the modes that were in use, and gives back those before it.
TEST_F(WindowModes, AReplayShowsTheModeOfTheAttempt) {
    // It runs by the clock, of which a frame takes more on a busy machine: one of the pictures
    // falls into the stretch with the gate.
    constexpr int kPictures = 8;
    const auto name = [](int n) { return "replay" + std::to_string(n); };
    std::string replay = "key p\n";
    for (int n = 0; n < kPictures; ++n) replay += "wait 6\n" + shot(name(n));
    const CommandResult result =
        run("--model paper",
            "wait 4\nhold e 118\nkey b\nwait 6\nkey 3 shift\nwait 60\nkey 1 shift\n"
            "wait 20\nkey b\nwait 4\n" +
                replay + "key p\nwait 4\nkey escape\nwait 4\n" + shot("scan") + "quit\n");
    ASSERT_EQ(result.status, 0) << result.error;
    int with_gate = 0;
    for (int n = 0; n < kPictures; ++n) {
        if (!says(name(n), " gate\n")) continue;
        ++with_gate;
        EXPECT_TRUE(says(name(n), " time\n"));
    }
    EXPECT_GT(with_gate, 0);
    EXPECT_FALSE(says("scan", " gate\n"));
}

// A drag that begins in the box moves the box and not the probe.
TEST_F(WindowModes, TheBoxAndTheGateFollowTheMouse) {
    const CommandResult result =
        run("--model paper --record " + (folder_ / "session.igs.mha"),
            "wait 4\nkey 2 shift\nwait 20\n" + shot("before") +
                "move 635 300\ndown 0\nwait 1\nmove 655 320\nwait 1\nmove 675 340\nwait 1\nup 0\n"
                "wait 20\n" +
                shot("after") + "key 3 shift\nwait 4\n" + "quit\n");
    ASSERT_EQ(result.status, 0) << result.error;
    const auto sequence = load_sequence(folder_ / "session.igs.mha");
    ASSERT_TRUE(sequence);
    const auto session = session_from_sequence(*sequence, guess_names(*sequence), "session");
    ASSERT_TRUE(session);
    std::vector<double> lefts;
    for (const SessionSample& sample : session->samples) {
        const std::string left = detail_value(sample.settings, "box_left");
        if (!left.empty()) lefts.push_back(std::stod(left));
    }
    ASSERT_GE(lefts.size(), 2u);
    EXPECT_GT(lefts.back(), lefts.front() + 0.02);
    const Point3 first = Point3{} + session->samples.front().mannequin_from_probe.translation,
                 last = Point3{} + session->samples.back().mannequin_from_probe.translation;
    EXPECT_EQ(distance(first, last), 0);
}

TEST_F(WindowModes, TissueIsNamedUnderThePointerAndOutlinedButNotInAnExam) {
    const std::string look = "wait 4\nmove 640 240\nwait 3\n";
    CommandResult result =
        run("--model paper", look + shot("named") + "hold u 12\n" + shot("plain") + "quit\n");
    ASSERT_EQ(result.status, 0) << result.error;
    EXPECT_TRUE(says("named", " Muscle\n"));
    std::string exam = sonocase::testing::small_exercise_toml();
    folder_.write("exam.toml", "mode = \"exam\"\n" + exam);
    result = run("--model paper --exercise " + (folder_ / "exam.toml"),
                 "wait 4\nkey b\n" + look + shot("exam") + "quit\n");
    ASSERT_EQ(result.status, 0) << result.error;
    EXPECT_FALSE(says("exam", " Muscle\n"));
}

}  // namespace
}  // namespace sonocase::runtime
