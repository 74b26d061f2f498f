// SPDX-License-Identifier: Apache-2.0

// Every panel compared with its kept picture, at 1280 x 720 and at 3840 x 2160.
//     SONOCASE_RENEW_PICTURES=1 build/release/bin/runtime_window_test --gtest_filter='WindowP*'
// writes the pictures of tests/golden/window/ again; look at them afterwards.
#include <gtest/gtest.h>

#include <filesystem>

#include "formats/bundle/case_bundle.h"
#include "formats/files/load_save.h"
#include "runtime/player/ui/window_picture.h"
#include "support/flowing_case.h"
#include "support/paths.h"
#include "support/run_command.h"
#include "support/temporary_folder.h"

namespace sonocase::runtime {
namespace {

using sonocase::testing::load_picture;
using sonocase::testing::Picture;

const char* const kPanels[] = {"panels",      "frozen", "help",     "setup",    "scores",
                               "needle_view", "cases",  "attempt",  "replay",   "tracker",
                               "effects",     "colour", "spectrum", "exercises"};

// A tour of all panels.
std::string script(const std::string& folder) {
    const auto shot = [&](const char* name) { return "shot " + folder + "/" + name + ".png\n"; };
    return "only-shots\nwait 12\nkey n\nhold w 20\nwait 8\n" + shot("panels") +
           "key o\nkey o\nwait 4\n" + shot("needle_view") + "key o\nwait 3\n" +
           "key space\nwait 6\n" + shot("frozen") + "key space\nwait 2\n" + "key f1\nwait 3\n" +
           shot("help") + "key f1\nkey f3\nwait 3\n" + shot("setup") +
           "key escape\nkey f9\nwait 3\n" + shot("tracker") + "key f9\nkey f10\nwait 3\n" +
           shot("effects") + "key f10\nkey b\nwait 20\n" + shot("attempt") + "key b\nwait 6\n" +
           shot("scores") + "key p\nwait 6\n" + shot("replay") +
           "key p\nwait 3\nkey escape\nkey f8\nwait 3\n" + shot("exercises") +
           "key f8\nhold e 118\nkey 2 shift\nwait 20\n" + shot("colour") +
           "key 3 shift\nwait 300\n" + shot("spectrum") + "key 1 shift\nkey f2\nwait 60\n" +
           shot("cases") + "quit\n";
}

// The kept pictures are means of 4 x 4 pixels (12 x 12 of the large window). The edges of letters,
// which differ between font renderers, and speckle, which differs between frames, average out; a
// panel, a heading, a colour or a row that has moved does not. Times, rates and scores change a few
// blocks in every run.
constexpr double kMeanLevels = 4;       // of all blocks: noise of 20 levels / 4, and less elsewhere
constexpr int kChangedLevels = 40;      // of a block that shows something else ...
constexpr double kChangedShare = 0.03;  // ... and how many of these may differ: numbers, noise

TEST(WindowPictures, EveryPanelLooksAsKeptAtBothSizes) {
    if (!std::filesystem::exists("/usr/share/fonts/truetype/dejavu/DejaVuSans.ttf"))
        GTEST_SKIP() << "the kept pictures are of DejaVu Sans, which is not installed";
    const bool renew = std::getenv("SONOCASE_RENEW_PICTURES") != nullptr;
    const std::string kept_folder = SONOCASE_SOURCE "/tests/golden/window/";
    const struct {
        const char *size, *screen, *scale;
        int by;
    } windows[] = {{"1280x720", "1280x720", "1", 4}, {"3840x2160", "3840x2160", "3", 12}};
    for (const auto& window : windows) {
        const sonocase::testing::TemporaryFolder folder;
        // The list of cases shows folder and size, which must be the same in every run.
        const std::string place = folder / "home";
        std::filesystem::create_directories(place);
        ASSERT_TRUE(save_bundle(sonocase::testing::flowing_case(), place + "/cylinder.sonocase"));
        folder.write("home/sonocase/player.json", R"({"sound": false})");
        folder.write("script", script(folder.path()));
        const auto result = sonocase::testing::run_command(
            "cd " + place + " && env XDG_CONFIG_HOME=" + place + " XDG_DATA_HOME=" + place +
            " XDG_DATA_DIRS=/nowhere " SONOCASE_SOURCE "/tests/support/on-display " +
            window.screen +
            " " SONOCASE_BIN "/sonoplay cylinder.sonocase --frame-budget 0 --size " + window.size +
            " --ui-scale " + window.scale + " --script " + (folder / "script"));
        ASSERT_EQ(result.status, 0) << result.error;
        for (const char* panel : kPanels) {
            const Picture seen = load_picture(folder / (std::string(panel) + ".png"));
            ASSERT_GT(seen.width, 0) << panel;
            const Picture small = seen.reduced(window.by);
            const std::string kept_file = kept_folder + panel + ".png";
            if (renew && window.by == 4) {
                std::filesystem::create_directories(kept_folder);
                ASSERT_TRUE(save_picture(small, kept_file)) << kept_file;
            }
            const Picture kept = load_picture(kept_file);
            ASSERT_EQ(kept.width, small.width) << kept_file;
            ASSERT_EQ(kept.height, small.height) << kept_file;
            double levels = 0;
            for (std::size_t i = 0; i < kept.rgb.size(); ++i)
                levels += std::abs(kept.rgb[i] - small.rgb[i]);
            levels /= static_cast<double>(kept.rgb.size());
            const double changed =
                small.difference(kept, 0, 0, kept.width, kept.height, kChangedLevels);
            EXPECT_LT(levels, kMeanLevels) << panel << " at " << window.size;
            EXPECT_LT(changed, kChangedShare) << panel << " at " << window.size;
            if (::testing::Test::HasFailure()) {
                save_picture(small, std::string(panel) + "_seen.png");
                FAIL() << "what was seen is " << panel << "_seen.png in the working folder";
            }
        }
    }
}

// The picture of docs/training.md is of the window as it is: its console and the row under the
// picture are those of the kept one, whatever the case. `scripts/draw-pictures window` draws it.
TEST(WindowPictures, TheOneOfTheDocumentsIsOfThisWindow) {
    const Picture drawn =
        load_picture(SONOCASE_SOURCE "/docs/pictures/training/window.png").reduced(4);
    const Picture kept = load_picture(SONOCASE_SOURCE "/tests/golden/window/panels.png");
    ASSERT_EQ(drawn.width, kept.width);
    ASSERT_EQ(drawn.height, kept.height);
    const struct {
        const char* what;
        int x0, y0, x1, y1;  // of 320 x 180
    } parts[] = {{"console", 246, 12, 318, 178}, {"row under the picture", 72, 162, 244, 178}};
    for (const auto& part : parts)
        EXPECT_LT(drawn.difference(kept, part.x0, part.y0, part.x1, part.y1, kChangedLevels),
                  kChangedShare)
            << part.what;
}

}  // namespace
}  // namespace sonocase::runtime
