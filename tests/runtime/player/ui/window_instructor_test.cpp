// SPDX-License-Identifier: Apache-2.0

// The instructor's display: a second window of one session.
#include <gtest/gtest.h>

#include <algorithm>
#include <fstream>
#include <sstream>

#include "runtime/player/ui/window_picture.h"
#include "support/flowing_case.h"
#include "window_run.h"

namespace sonocase::runtime {
namespace {

using sonocase::testing::CommandResult;
using sonocase::testing::load_picture;
using sonocase::testing::Picture;
using sonocase::testing::read_text;

const char* const kMarks = R"(
[[pass_marks]]
metric = "final_tip_to_target_mm"
at_most = 6
[[pass_marks]]
metric = "needle_in_beam_fraction"
at_least = 0.5
)";

class InstructorWindow : public sonocase::testing::WindowRun {
  protected:
    InstructorWindow() : WindowRun(sonocase::testing::flowing_case(), "tube.sonocase") {
        folder_.write(
            "exam.toml",
            "mode = \"exam\"\n" + std::string(sonocase::testing::small_exercise_toml()) + kMarks);
    }
    CommandResult run(const std::string& arguments,
                      const std::string& script,
                      const std::string& language = "C",
                      const std::string& size = "1280x720") {
        return in_display(command("--model paper --frame-budget 0 " + arguments, script, size),
                          language, size);
    }
};

TEST_F(InstructorWindow, ShowsTargetNamesMarksAndTrackerInAnExamThatShowsNone) {
    const CommandResult result =
        run("--instructor --exercise " + (folder_ / "exam.toml"),
            "wait 6\nkey b\nkey n\nhold w 20\nwait 6\nshot " + file("trainee") + "\ninstructor " +
                file("instructor") + "\nquit\n");
    ASSERT_EQ(result.status, 0) << result.error;
    EXPECT_EQ(result.error, "");
    for (const char* words : {" Tip to target\n", " Pass marks\n", " Tracker\n", " at most 6 mm\n",
                              " EXAM\n", " Mouse and keyboard\n"})
        EXPECT_TRUE(says("instructor", words)) << words;
    EXPECT_FALSE(says("trainee", " Tip to target\n"));
    EXPECT_FALSE(says("trainee", " Pass marks\n"));
    // Outlines are white in the middle of the picture, where the trainee's shows tissue.
    const Picture theirs = load_picture(file("trainee")), ours = load_picture(file("instructor"));
    ASSERT_EQ(ours.width, 1280);
    const auto white = [](const Picture& picture) {
        int count = 0;
        for (int y = 150; y < 560; ++y) {
            for (int x = 400; x < 880; ++x)
                count += picture.rgb[3 * (static_cast<std::size_t>(y) * picture.width + x)] > 225;
        }
        return count;
    };
    EXPECT_GT(white(ours), white(theirs) + 100);
}

// But for the tracker's, which says how long frames take and is as wide as that.
std::string boxes_of(const std::string& picture) {
    std::istringstream lines(read_text(picture + ".boxes"));
    std::string kept;
    for (std::string line; std::getline(lines, line);)
        if (!line.ends_with(" tracker")) kept += line + "\n";
    return kept;
}

// The same run with and without the second window gives the trainee the same boxes.
TEST_F(InstructorWindow, ChangesNothingOfTheTraineesWindow) {
    const std::string script = "wait 6\nkey space\nwait 6\nshot " + file("seen") + "\nquit\n";
    ASSERT_EQ(run("", script).status, 0);
    const std::string boxes = boxes_of(file("seen"));
    const CommandResult result = run("--instructor", script);
    ASSERT_EQ(result.status, 0) << result.error;
    EXPECT_FALSE(boxes.empty());
    EXPECT_EQ(boxes_of(file("seen")), boxes);
    EXPECT_EQ(load_picture(file("seen")).width, 1280);
}

TEST_F(InstructorWindow, OpensAndClosesFromTheSettingsAndSaysWhenThereIsNoCase) {
    const CommandResult result =
        run("", "wait 4\npress settings\nwait 2\npress Instructor\nwait 4\ninstructor " +
                    file("on") + "\nkey f2\nwait 20\nkey f1\nwait 2\ninstructor " + file("cases") +
                    "\nkey escape\npress settings\nwait 2\npress Instructor\nwait 4\ninstructor " +
                    file("off") + "\nquit\n");
    ASSERT_EQ(result.status, 0) << result.error;
    EXPECT_EQ(load_picture(file("on")).width, 1280);
    EXPECT_TRUE(says("cases", " Tip to target\n"));  // the case is still open
    EXPECT_EQ(load_picture(file("off")).width, 0);   // no such window: no file
}

// Words and cards of the display lie inside of each other and overlap nothing, at three sizes and
// in both languages.
TEST_F(InstructorWindow, NothingOverlapsOrIsCut) {
    for (const char* language : {"C", "de_DE.UTF-8"}) {
        for (const char* size : {"960x600", "1280x720", "1920x1080"}) {
            SCOPED_TRACE(std::string(size) + " " + language);
            const CommandResult result =
                run("--instructor --exercise " + (folder_ / "exam.toml"),
                    "wait 6\nkey b\nkey n\nhold w 20\nwait 6\ninstructor " + file("during") +
                        "\nkey b\nwait 2\nkey b\nwait 4\ninstructor " + file("after") + "\nquit\n",
                    language, size);
            ASSERT_EQ(result.status, 0) << result.error;
            for (const char* name : {"during", "after"}) {
                struct Words {
                    double x, y, w, h;
                    std::string words;
                };
                std::vector<Words> all;
                std::ifstream in(file(name) + ".boxes");
                for (std::string line; std::getline(in, line);) {
                    std::istringstream fields(line);
                    std::string kind;
                    Words b;
                    int layer = 0, cut = 0;
                    fields >> kind >> layer >> b.x >> b.y >> b.w >> b.h >> cut;
                    std::getline(fields >> std::ws, b.words);
                    EXPECT_NE(kind, "untranslated") << b.words;
                    EXPECT_EQ(cut, 0) << b.words;
                    if (kind == "words") all.push_back(b);
                }
                EXPECT_GT(all.size(), 8u) << name;
                for (std::size_t i = 0; i < all.size(); ++i) {
                    for (std::size_t k = i + 1; k < all.size(); ++k) {
                        const Words &a = all[i], &b = all[k];
                        const double across = std::min(a.x + a.w, b.x + b.w) - std::max(a.x, b.x);
                        const double down = std::min(a.y + a.h, b.y + b.h) - std::max(a.y, b.y);
                        EXPECT_FALSE(across > 0.6 && down > 1.5) << a.words << " on " << b.words;
                    }
                }
            }
        }
    }
}

}  // namespace
}  // namespace sonocase::runtime
