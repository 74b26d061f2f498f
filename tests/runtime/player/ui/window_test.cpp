// SPDX-License-Identifier: Apache-2.0

// The window on a virtual display, driven by injected input: opens every panel, attempts an
// exercise, takes pictures and checks them.
#include <gtest/gtest.h>

#include <cctype>
#include <filesystem>
#include <map>
#include <nlohmann/json.hpp>

#include "formats/bundle/case_bundle.h"
#include "formats/files/load_save.h"
#include "runtime/player/ui/keys.h"
#include "runtime/player/ui/window_picture.h"
#include "support/paths.h"
#include "support/run_command.h"
#include "support/small_case.h"
#include "support/temporary_folder.h"

namespace sonocase::runtime {
namespace {

using sonocase::testing::CommandResult;
using sonocase::testing::load_picture;
using sonocase::testing::Picture;

class WindowOnVirtualDisplay : public ::testing::Test {
  protected:
    void SetUp() override {
        bundle_ = folder_ / "cylinder.sonocase";
        ASSERT_TRUE(save_bundle(sonocase::testing::small_case(), bundle_));
    }
    CommandResult run(const std::string& arguments,
                      const std::string& script,
                      const std::string& screen,
                      const std::string& language = "C") {
        folder_.write("script", script);
        return sonocase::testing::run_command(
            "env LC_ALL=" + language + " XDG_CONFIG_HOME=" + (folder_ / "config") +
            " XDG_DATA_HOME=" + (folder_ / "data") +
            " " SONOCASE_SOURCE "/tests/support/on-display " + screen +
            " " SONOCASE_BIN "/sonoplay " + arguments + " --script " + (folder_ / "script"));
    }
    sonocase::testing::TemporaryFolder folder_;
    std::string bundle_;
};

TEST_F(WindowOnVirtualDisplay, PlaysAnExerciseFromInjectedInput) {
    const std::string shots = folder_.path() + "/";
    const CommandResult result =
        run(bundle_ + " --size 1280x720 --model paper --stats " + (folder_ / "stats.json"),
            "wait 8\nshot " + shots +
                "start.png\n"
                "key b\nkey n\nhold w 25\nwait 4\nshot " +
                shots +
                "needle.png\n"
                "key space\nwait 3\nshot " +
                shots + "frozen.png\nwait 6\nshot " + shots +
                "still.png\n"
                "key m\nmove 560 300\ndown 0\nup 0\nmove 700 400\ndown 0\nup 0\nwait 2\nshot " +
                shots +
                "measured.png\nkey space\n"
                "key b\nwait 4\nshot " +
                shots + "scores.png\nkey escape\nkey f1\nwait 2\nshot " + shots +
                "help.png\nkey f1\nkey f3\nwait 2\nshot " + shots +
                "setup.png\nkey escape\n"
                "hold pageup 60\nwait 6\nshot " +
                shots + "lifted.png\nkey f2\nwait 2\nshot " + shots + "cases.png\nquit\n",
            "1280x720");
    ASSERT_EQ(result.status, 0) << result.error;
    EXPECT_EQ(result.error, "");
    const auto shot = [&](const char* name) { return load_picture(shots + name + ".png"); };
    const Picture start = shot("start"), needle = shot("needle"), frozen = shot("frozen"),
                  still = shot("still"), lifted = shot("lifted");
    for (const char* name : {"start", "needle", "frozen", "still", "measured", "scores", "help",
                             "setup", "lifted", "cases"}) {
        ASSERT_EQ(shot(name).width, 1280) << name;
        ASSERT_EQ(shot(name).height, 720) << name;
        EXPECT_GT(shot(name).mean(0, 0, 1280, 720), 8) << name;
    }
    // The picture is in the middle; panels stand at its sides.
    EXPECT_GT(start.mean(500, 250, 750, 500), 25);
    EXPECT_GT(start.difference(needle, 400, 150, 900, 600), 0.005);  // a thin line
    EXPECT_EQ(frozen.difference(still, 400, 150, 900, 600), 0);
    EXPECT_GT(still.difference(shot("measured"), 400, 250, 900, 500), 0);
    EXPECT_GT(start.difference(shot("help"), 340, 60, 940, 480), 0.5);
    EXPECT_GT(start.difference(shot("scores"), 340, 110, 940, 600), 0.5);
    EXPECT_GT(start.difference(shot("setup"), 300, 170, 980, 540), 0.5);
    EXPECT_LT(lifted.mean(500, 250, 750, 500), 0.5 * start.mean(500, 250, 750, 500));
    const auto stats = nlohmann::json::parse(sonocase::testing::read_text(folder_ / "stats.json"));
    EXPECT_GT(stats["frames"].get<int>(), 10);
    EXPECT_GT(stats["first_frame_ms"].get<double>(), 0);
    EXPECT_TRUE(std::filesystem::exists(folder_ / "config/sonocase/player.json"));
    int sessions = 0;
    for (const auto& entry :
         std::filesystem::directory_iterator(folder_ / "data/sonocase/sessions")) {
        sessions += entry.path().string().find(".frames.") == std::string::npos;
    }
    EXPECT_EQ(sessions, 1);
}

// From the start page to the second attempt and its replay, in the fewest inputs: Enter starts
// practice, N takes the needle, W pushes it, B ends the attempt, P plays it, P goes back, B starts
// the next. The bar is twelve.
TEST_F(WindowOnVirtualDisplay, ANewcomerIsAtTheSecondAttemptAfterSevenInputs) {
    std::filesystem::create_directories(folder_ / "data/sonocase/cases");
    std::filesystem::copy(bundle_, folder_ / "data/sonocase/cases/cylinder.sonocase");
    const std::string shots = folder_.path() + "/";
    const std::string script =
        "wait 60\nkey enter\nwait 6\nkey n\nhold w 20\nwait 4\nkey b\nwait 4\nshot " + shots +
        "after.png\nkey p\nwait 6\nshot " + shots +
        "replay.png\nkey p\nwait 3\nkey b\nwait 4\nshot " + shots + "second.png\nquit\n";
    int inputs = 0;
    for (std::size_t at = 0; at < script.size(); at = script.find('\n', at) + 1)
        inputs += script.compare(at, 4, "key ") == 0 || script.compare(at, 5, "hold ") == 0;
    EXPECT_EQ(inputs, 7);
    const CommandResult result = run("--size 1280x720 --model paper", script, "1280x720");
    ASSERT_EQ(result.status, 0) << result.error;
    const auto has = [&](const char* shot, const std::string& name) {
        return sonocase::testing::read_text(shots + shot + ".png.boxes").find(name) !=
               std::string::npos;
    };
    // Controls that only these pages have.
    EXPECT_TRUE(has("after", " again\n"));
    EXPECT_TRUE(has("replay", " time\n"));  // the time line
    EXPECT_FALSE(has("second", " time\n"));
    EXPECT_TRUE(has("second", " hint\n"));  // an attempt at practice runs
    int sessions = 0;
    for (const auto& entry :
         std::filesystem::directory_iterator(folder_ / "data/sonocase/sessions")) {
        sessions += entry.path().string().find(".frames.") == std::string::npos;
    }
    EXPECT_EQ(sessions, 2);
}

// From the start page into the course: the course, the answer, Enter. The bar is six.
TEST_F(WindowOnVirtualDisplay, ANewcomerIsAtTheFirstStepOfTheCourseAfterThreeInputs) {
    std::filesystem::create_directories(folder_ / "data/sonocase/cases");
    std::filesystem::copy(bundle_, folder_ / "data/sonocase/cases/cylinder.sonocase");
    std::string course = "name = \"short\"\ntitle = \"A short course\"\n";
    for (const char* name : {"first", "second"})
        course += std::string("[[modules]]\nname = \"") + name +
                  "\"\ntext = \"What to know.\"\ncase = \"" +
                  sonocase::testing::small_case().manifest.case_name +
                  "\"\nexercise = \"scan\"\nexpert = \"along\"\n"
                  "question = \"Which?\"\noptions = [\"This\", \"That\"]\nanswer = 1\n"
                  "because = \"For this reason.\"\n"
                  "practice = { measure = \"final_tip_to_target_mm\", at_most = 5 }\n"
                  "gate = { passes_in_a_row = 2, steady = true }\nretention_days = 30\n";
    folder_.write("data/sonocase/cases/course.toml", course);
    const std::string shots = folder_.path() + "/";
    const std::string way = "wait 60\npress course\nwait 4\nshot " + shots +
                            "question.png\npress option0\nwait 4\nshot " + shots +
                            "text.png\nkey enter\nwait 6\nshot " + shots + "step.png\n";
    int inputs = 0;
    for (std::size_t at = 0; at < way.size(); at = way.find('\n', at) + 1)
        inputs += way.compare(at, 4, "key ") == 0 || way.compare(at, 6, "press ") == 0;
    EXPECT_EQ(inputs, 3);
    // The attempt's result leads back; the expert plays and Escape leads back too.
    const std::string back = "key b\nwait 4\npress course\nwait 4\nshot " + shots +
                             "back.png\npress module_second\nwait 4\nshot " + shots +
                             "locked.png\npress expert\nwait 10\nshot " + shots +
                             "expert.png\nkey escape\nwait 4\nshot " + shots + "after.png\nquit\n";
    for (const char* language : {"C", "de_DE.UTF-8"}) {
        const CommandResult result =
            run("--size 1280x720 --model paper", way + back, "1280x720", language);
        ASSERT_EQ(result.status, 0) << result.error;
        const auto has = [&](const char* shot, const std::string& name) {
            return sonocase::testing::read_text(shots + shot + ".png.boxes").find(name) !=
                   std::string::npos;
        };
        EXPECT_TRUE(has("question", " option0\n"));
        EXPECT_FALSE(has("question", "What to know."));  // asked before it is read
        EXPECT_TRUE(has("text", "What to know."));
        EXPECT_TRUE(has("text", "For this reason."));
        EXPECT_TRUE(has("step", " hint\n"));  // an attempt at practice runs
        EXPECT_TRUE(has("back", " module_first\n"));
        EXPECT_TRUE(has("locked", "A short course"));
        EXPECT_TRUE(has("expert", " time\n"));  // the time line of what is played
        EXPECT_TRUE(has("after", " module_first\n"));
        std::filesystem::remove_all(folder_ / "data/sonocase/sessions");
    }
}

// Colour never on the picture, frozen or live: the sector stays grey (saturation at most 0.15).
TEST_F(WindowOnVirtualDisplay, ThePictureIsGreyAndStaysInItsPlace) {
    const std::string shots = folder_.path() + "/";
    const CommandResult result =
        run(bundle_ + " --size 1280x720 --model paper",
            "wait 6\nshot " + shots + "live.png\nkey space\nwait 3\nshot " + shots +
                "frozen.png\nquit\n",
            "1280x720");
    ASSERT_EQ(result.status, 0) << result.error;
    for (const char* name : {"live", "frozen"}) {
        const Picture picture = load_picture(shots + name + ".png");
        ASSERT_EQ(picture.width, 1280);
        int coloured = 0;
        for (int y = 60; y < 640; ++y) {
            for (int x = 300; x < 970; ++x) {
                const std::uint8_t* p = &picture.rgb[3 * (static_cast<std::size_t>(y) * 1280 + x)];
                const int high = std::max({p[0], p[1], p[2]}), low = std::min({p[0], p[1], p[2]});
                coloured += high > 40 && high - low > 0.15 * high;
            }
        }
        EXPECT_EQ(coloured, 0) << name;
    }
}

TEST_F(WindowOnVirtualDisplay, IsTheSameLayoutAtFourTimesTheSize) {
    const CommandResult result =
        run(bundle_ + " --size 3840x2160 --ui-scale 3 --model paper",
            "wait 6\nshot " + (folder_ / "big.png") + "\nquit\n", "3840x2160");
    ASSERT_EQ(result.status, 0) << result.error;
    const Picture big = load_picture(folder_ / "big.png");
    ASSERT_EQ(big.width, 3840);
    ASSERT_EQ(big.height, 2160);
    EXPECT_GT(big.mean(1500, 750, 2250, 1500), 25);
}

TEST_F(WindowOnVirtualDisplay, GoesOnAfterWhatIsWrong) {
    folder_.write("damaged.sonocase", sonocase::testing::read_text(bundle_).substr(0, 3000));
    CommandResult result = run(folder_ / "damaged.sonocase", "wait 4\nquit\n", "1280x720");
    EXPECT_EQ(result.status, 0);  // the list of bundles is there
    EXPECT_NE(result.error.find("damaged.sonocase"), std::string::npos) << result.error;
    result = run(bundle_ + " --tracker sweep:none --model paper", "wait 4\nquit\n", "1280x720");
    EXPECT_EQ(result.status, 0);
    EXPECT_NE(result.error.find("no sweep named none"), std::string::npos) << result.error;
    result = run(bundle_ + " --tracker viper --model paper", "wait 30\nquit\n", "1280x720");
    EXPECT_EQ(result.status, 0) << result.error;
    folder_.write("config/sonocase/player.json", "{ broken");
    result = run(bundle_ + " --model paper", "wait 4\nquit\n", "1280x720");
    EXPECT_EQ(result.status, 0);
    EXPECT_NE(result.error.find("player.json"), std::string::npos) << result.error;
}

TEST_F(WindowOnVirtualDisplay, SaysWhatATrackerAndABundleLack) {
    CommandResult result =
        run(bundle_ + " --tracker viper --model paper", "wait 60\nquit\n", "1280x720");
    EXPECT_EQ(result.status, 0);
    EXPECT_NE(result.error.find("plugged in"), std::string::npos) << result.error;
    result = run(SONOCASE_SOURCE "/tests/data/versions/case-future.sonocase", "wait 4\nquit\n",
                 "1280x720");
    EXPECT_EQ(result.status, 0);  // the list of bundles is there
    EXPECT_NE(result.error.find("format version 9"), std::string::npos) << result.error;
}

TEST_F(WindowOnVirtualDisplay, WithoutOpenGl33SaysSoInOneLine) {
    ::setenv("MESA_GL_VERSION_OVERRIDE", "2.1", 1);
    const CommandResult result = run(bundle_, "quit\n", "1280x720");
    ::unsetenv("MESA_GL_VERSION_OVERRIDE");
    EXPECT_EQ(result.status, 1);
    EXPECT_NE(result.error.find("OpenGL"), std::string::npos) << result.error;
    EXPECT_NE(result.error.find("--headless"), std::string::npos) << result.error;
    EXPECT_EQ(std::count(result.error.begin(), result.error.end(), '\n'), 1) << result.error;
}

// The help lists every key that the window reads, and docs/player.md has every line of the help.
TEST(Shortcuts, EveryKeyOfTheWindowIsInTheHelpAndEveryLineOfItInTheDocument) {
    const std::string source =
        sonocase::testing::read_text(SONOCASE_SOURCE "/runtime/player/ui/keys.cpp");
    const std::string document = sonocase::testing::read_text(SONOCASE_SOURCE "/docs/player.md");
    std::string help;
    for (const Shortcut& s : shortcuts()) {
        if (!s.keys) continue;
        help += std::string(" ") + s.keys + " " + s.does + " ";
        EXPECT_NE(document.find(std::string("| `") + s.keys + "` |"), std::string::npos) << s.keys;
    }
    const std::map<std::string, std::string> written = {
        {"LEFT", "rrows"},        {"RIGHT", "rrows"},
        {"UP", "rrows"},          {"DOWN", "rrows"},
        {"PAGE_UP", "Page Up"},   {"PAGE_DOWN", "Page Down"},
        {"HOME", "Home"},         {"SPACE", "Space"},
        {"ESCAPE", "Escape"},     {"ENTER", "Enter"},
        {"COMMA", " , "},         {"PERIOD", " . "},
        {"LEFT_BRACKET", " [ "},  {"RIGHT_BRACKET", " ] "},
        {"SEMICOLON", " ; "},     {"APOSTROPHE", " ' "},
        {"MINUS", " - "},         {"EQUAL", " = "},
        {"KP_ADD", "Ctrl + / -"}, {"KP_SUBTRACT", "Ctrl + / -"}};
    int keys = 0;
    const std::string mark = "GLFW_KEY_";
    for (std::size_t at = source.find(mark); at != std::string::npos;
         at = source.find(mark, at + 1), ++keys) {
        std::size_t end = at + mark.size();
        while (end < source.size() && (std::isalnum(source[end]) || source[end] == '_')) ++end;
        const std::string key = source.substr(at + mark.size(), end - at - mark.size());
        const auto special = written.find(key);
        const std::string words = special != written.end() ? special->second : " " + key + " ";
        EXPECT_NE(help.find(words), std::string::npos) << key;
    }
    EXPECT_GT(keys, 40);
}

TEST_F(WindowOnVirtualDisplay, WithoutADisplaySaysSoInOneLine) {
    const CommandResult result = sonocase::testing::run_command(
        "env -u DISPLAY -u WAYLAND_DISPLAY " SONOCASE_BIN "/sonoplay " + bundle_);
    EXPECT_EQ(result.status, 1);
    EXPECT_NE(result.error.find("--headless"), std::string::npos) << result.error;
    EXPECT_EQ(std::count(result.error.begin(), result.error.end(), '\n'), 1) << result.error;
}

}  // namespace
}  // namespace sonocase::runtime
