// SPDX-License-Identifier: Apache-2.0

// The boxes of every page and dialog as they are drawn, at three sizes and four scales, in both
// languages: no control or word overlaps another on its layer, nothing leaves the window, no words
// are cut that are not meant to be, every word is translated, and the picture keeps its place.
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <future>
#include <list>
#include <sstream>

#include "formats/bundle/case_bundle.h"
#include "formats/files/load_save.h"
#include "formats/progress_book/progress_book.h"
#include "runtime/player/ui/window_picture.h"
#include "support/flowing_case.h"
#include "support/paths.h"
#include "support/run_command.h"
#include "support/temporary_folder.h"

namespace sonocase::runtime {
namespace {

struct SeenBox {
    std::string kind;
    int layer = 0;
    double x = 0, y = 0, w = 0, h = 0;
    int cut = 0;
    std::string name;
};

std::vector<SeenBox> load_boxes(const std::string& file) {
    std::vector<SeenBox> boxes;
    std::ifstream in(file);
    for (std::string line; std::getline(in, line);) {
        std::istringstream words(line);
        SeenBox b;
        words >> b.kind >> b.layer >> b.x >> b.y >> b.w >> b.h >> b.cut;
        std::getline(words >> std::ws, b.name);
        boxes.push_back(b);
    }
    return boxes;
}

const char* const kPages[] = {
    "scan",     "attempt",   "frozen",    "after",   "replay",   "help",     "tracker", "effects",
    "cases",    "exercises", "setup",     "colour",  "spectrum", "motion",   "named",   "marks",
    "settings", "notices",   "class",     "sign_in", "longest",  "question", "asked",   "hinted",
    "in_hand",  "tray",      "checklist", "told",    "course",   "module",   "locked",  "watched"};

// A procedure with as many acts as the tray has keys, long words, and a question.
const char* const kProcedure = R"(name = "procedure"
title = "A procedure with a long title that takes two lines of the card"
hints = ["The vessel beside the target runs up the inner side of the flank, behind the straight muscle of the belly. Colour shows it."]
[probe]
shape = "linear"
depth_mm = 60
[needle]
length_mm = 100
[[targets]]
name = "lesion"
centre = [0, 0, 0]
radius_mm = 5
[procedure]
cut = 1
[[steps]]
name = "numb"
title = "Numb the way down to the capsule, with all that is needed"
instruction = "Inject at least 5 ml on the way, no deeper than 35 mm, and wait until it works."
done = { act = "inject", at_least = 5 }
[[steps]]
name = "draw"
done = { act = "aspirate", at_least = 1 }
[[steps]]
name = "throw"
done = { act = "core_throw", at_least = 15 }
[[steps]]
name = "wire"
done = { act = "wire", at_least = 100 }
[[steps]]
name = "catheter"
done = { act = "catheter" }
[[steps]]
name = "again"
done = { act = "rescan" }
[[items]]
name = "numbed"
title = "The way numbed down to the capsule, before anything else was done"
critical = true
step = "numb"
[[items]]
name = "asked"
title = "Clotting checked"
question = "INR is 2.1 and nothing else is known about the patient. What do you do now?"
options = ["Go on", "Wait until clotting is corrected or the way is another", "Take a thinner needle"]
answer = 1
[texts.de]
title = "Ein Ablauf mit einem langen Namen, der zwei Zeilen der Karte braucht"
hints = ["Das Gefäß neben dem Ziel zieht an der Innenseite der Flanke hinter dem geraden Bauchmuskel nach oben. Die Farbe zeigt es."]
[[texts.de.steps]]
name = "numb"
title = "Betäuben Sie den Weg bis zur Kapsel, mit allem, was dazu gehört"
instruction = "Mindestens 5 ml auf dem Weg, nicht tiefer als 35 mm, und warten Sie, bis es wirkt."
[[sweeps]]
name = "along"
[[sweeps.keys]]
time_s = 0
probe = [0, 0, 62]
needle_tip = [20, 0, 43]
needle_direction = [-8, 0, -9]
acts = "inject=6"
[[sweeps.keys]]
time_s = 60
probe = [0, 0, 62]
needle_tip = [16, 0, 39]
needle_direction = [-8, 0, -9]
)";

// The same without a question, and with as many acts as any scenario has: four rows of the tray.
std::string plain_procedure() {
    std::string toml = kProcedure;
    const auto erase = [&](const char* from, const char* until) {
        const auto begin = toml.find(from);
        toml.erase(begin, toml.find(until, begin) - begin);
    };
    erase("[[items]]\nname = \"asked\"", "[texts.de]");
    erase("[[steps]]\nname = \"wire\"", "[[steps]]\nname = \"catheter\"");
    return toml.replace(toml.find("\"procedure\""), 11, "\"plain\"");
}

// The spectral mode with its gain at -30 dB, a number of two digits and a sign.
std::string longest_values() {
    std::string keys = "key 3 shift\nwait 2\n";
    for (int i = 0; i < 30; ++i) keys += "key -\n";
    return keys;
}

std::string script(const std::string& folder) {
    const auto boxes = [&](const char* name) { return "boxes " + folder + "/" + name + "\n"; };
    return "only-shots\nwait 4\n" + boxes("scan") + "key f5\nwait 4\nkey b\nwait 4\n" +
           boxes("question") + "press later\nwait 2\npress ask\nwait 2\n" + boxes("asked") +
           "press later\nwait 2\nkey h\nwait 3\n" + boxes("hinted") +
           "key j\nkey k\nkey l\nkey i\nkey i ctrl\nwait 4\n" + boxes("tray") + "key n\nwait 4\n" +
           boxes("in_hand") + "key n\nwait 2\nkey b\nwait 8\n" + boxes("checklist") +
           "key escape\nkey f5\nwait 4\nkey b\nwait 4\nkey h\nwait 3\n" + boxes("told") +
           "key b\nwait 8\nkey escape\nkey f5 shift\nwait 4\n" +
           "key f5 shift\nwait 4\nkey b\nkey n\nhold w 6\nkey h\nwait 2\n" + boxes("attempt") +
           "key space\nwait 2\n" + boxes("frozen") + "key space\nwait 2\nkey b\nwait 3\n" +
           boxes("after") + "key p\nwait 2\n" + boxes("replay") + "key p\nwait 2\nkey escape\n" +
           "key f1\nwait 2\n" + boxes("help") + "key f1\nkey f9\nwait 2\n" + boxes("tracker") +
           "key f9\nkey f10\nwait 2\n" + boxes("effects") + "key f10\nkey f8\nwait 2\n" +
           boxes("exercises") + "press in_exam\npress marks\nwait 2\n" + boxes("marks") +
           "key escape\nkey f12\nwait 2\nkey f3\nwait 2\n" + boxes("setup") + "key f3\nhold u 6\n" +
           boxes("named") + "key 2 shift\nwait 6\n" + boxes("colour") + "key 3 shift\nwait 6\n" +
           boxes("spectrum") + "key 4 shift\nwait 6\n" + boxes("motion") + longest_values() +
           "wait 2\n" + boxes("longest") + "key 1 shift\nkey f2\nwait 30\n" + boxes("cases") +
           "press settings\nwait 2\n" + boxes("settings") + "press Notices\nwait 2\n" +
           boxes("notices") + "key escape\npress settings\nwait 2\npress Sign in\nwait 2\n" +
           boxes("sign_in") +
           "key escape\npress settings\nwait 2\npress Class\nwait 4\npress Ann Onymous\nwait 2\n" +
           boxes("class") + "key escape\npress settings\nwait 2\npress Course\nwait 4\n" +
           boxes("course") + "press option1\nwait 4\n" + boxes("module") +
           "press module_second\nwait 4\n" + boxes("locked") +
           "press module_first\nwait 4\npress expert\nwait 10\n" + boxes("watched") + "quit\n";
}

void check_boxes(const std::vector<SeenBox>& boxes, double width, double height) {
    ASSERT_GT(boxes.size(), 5u);
    std::vector<SeenBox> leaves;
    for (const SeenBox& b : boxes) {
        if (b.kind == "untranslated") {
            ADD_FAILURE() << "no translation of: " << b.name;
            continue;
        }
        EXPECT_FALSE(b.cut) << b.kind << " " << b.name << " is cut";
        EXPECT_GE(b.x, -1) << b.name;
        EXPECT_GE(b.y, -1) << b.name;
        EXPECT_LE(b.x + b.w, width + 1) << b.name;
        EXPECT_LE(b.y + b.h, height + 1) << b.name;
        if (b.kind == "control" || b.kind == "words") leaves.push_back(b);
    }
    for (std::size_t i = 0; i < leaves.size(); ++i) {
        for (std::size_t k = i + 1; k < leaves.size(); ++k) {
            const SeenBox &a = leaves[i], &b = leaves[k];
            if (a.layer != b.layer) continue;
            const double across = std::min(a.x + a.w, b.x + b.w) - std::max(a.x, b.x);
            const double down = std::min(a.y + a.h, b.y + b.h) - std::max(a.y, b.y);
            // A line's box has the font's whole height, which its letters do not fill.
            EXPECT_FALSE(across > 0.6 && down > 1.5)
                << a.kind << " " << a.name << " overlaps " << b.kind << " " << b.name;
        }
    }
}

const char* const kMarks = R"(
[[pass_marks]]
metric = "tissue_damage_mm2"
at_most = 1900
[[pass_marks]]
metric = "final_tip_to_target_mm"
at_most = 6.5
[[pass_marks]]
metric = "needle_in_beam_fraction"
at_least = 0.55
)";

// Its words are as long as those of the course at hand.
const char* const kCourse = R"(name = "course"
title = "A course with a title that does not go on for ever"
text = "From the first picture to a central line: modules in order, each with a gate. A wrong answer costs nothing."
[[modules]]
name = "first"
title = "The first of two modules"
text = """Depth first: what you look for should fill three quarters of the picture. Then focus to its depth, then gain until fluid
is just black, then the sliders of the TGC until one tissue has one grey from top to bottom."""
case = "cylinder"
exercise = "procedure"
expert = "along"
question = "You cannot see the far side of the kidney, which lies below the picture's edge. What first?"
options = ["More gain", "More depth, until what is looked for fills three quarters", "Press harder"]
answer = 1
because = "Only depth shows what lies below the edge; gain makes brighter what is shown already."
practice = { measure = "needle_in_beam_fraction", at_least = 0.6 }
gate = { passes_in_a_row = 3, steady = true }
retention_days = 30
[[modules]]
name = "second"
title = "The second"
text = "Short."
case = "elsewhere"
exercise = "procedure"
gate = { passes_in_a_row = 1, exam = true }
)";

// A class whose names, exercises and attempts are more than a small window shows.
void fill_book(const std::string& path) {
    auto book = ProgressBook::open(path);
    ASSERT_TRUE(book) << book.error().message();
    const char* const kNames[] = {"Ann Onymous", "Bernadette von Hohenfels-Trautmannsdorf",
                                  "Łukasz Żółć", "D",
                                  "E. Fünf",     "F",
                                  "G",           "H",
                                  "I",           "J",
                                  "K",           "L"};
    int minute = 0;
    for (const char* name : kNames) {
        for (int e = 0; e < 8; ++e) {
            for (int k = 0; k < 4; ++k) {
                ProgressEntry entry;
                entry.trainee = name;
                entry.case_name = "cylinder";
                entry.exercise = "exercise-with-a-name-" + std::to_string(e);
                entry.started = "2026-01-01T" + std::to_string(10 + minute / 60) + ":" +
                                std::to_string(10 + minute % 60) + ":00Z";
                ++minute;
                entry.passed = (minute + e) % 3 == 0;
                entry.metrics = {{"final_tip_to_target_mm", 12.0 - 2 * k}};
                if (e == 0)
                    for (const char* item :
                         {"way-found", "an-item-with-a-long-name-of-its-own", "numbed"})
                        entry.items.push_back({item, true, k > 1});
                ASSERT_TRUE(book->add(entry));
            }
        }
    }
}

struct Display {
    std::string size;
    double scale = 1;
    std::string language = "C";
};

// A visit to every page.
class Tour {
  public:
    explicit Tour(const Display& display) : display_(display) {
        const std::string place = folder_ / "home";
        std::filesystem::create_directories(place);
        CaseBundle bundle = sonocase::testing::flowing_case();
        bundle.exercises[0].toml += kMarks;
        bundle.exercises.push_back({"procedure", kProcedure});
        bundle.exercises.push_back({"plain", plain_procedure()});
        EXPECT_TRUE(save_bundle(bundle, place + "/cylinder.sonocase"));
        folder_.write("home/sonocase/player.json", R"({"sound": false})");
        folder_.write("home/course.toml", kCourse);
        fill_book(place + "/sonocase/progress.sqlite");
        folder_.write("script", script(folder_.path()));
        played_ =
            std::async(std::launch::async, sonocase::testing::run_command,
                       "cd " + place + " && env LC_ALL=" + display.language +
                           " XDG_CONFIG_HOME=" + place + " XDG_DATA_HOME=" + place +
                           " XDG_DATA_DIRS=/nowhere " SONOCASE_SOURCE "/tests/support/on-display " +
                           display.size +
                           " " SONOCASE_BIN "/sonoplay cylinder.sonocase --model paper --size " +
                           display.size + " --ui-scale " + std::to_string(display.scale) +
                           " --script " + (folder_ / "script"));
    }
    // Waits for its end and checks every page.
    void check();

  private:
    Display display_;
    sonocase::testing::TemporaryFolder folder_;
    std::future<sonocase::testing::CommandResult> played_;
};

void Tour::check() {
    const auto& [size, scale, language] = display_;
    SCOPED_TRACE(size + " at " + std::to_string(scale) + " in " + language);
    const auto result = played_.get();
    ASSERT_EQ(result.status, 0) << result.error;
    int width_px = 0, height_px = 0;
    ASSERT_EQ(std::sscanf(size.c_str(), "%dx%d", &width_px, &height_px), 2);
    const double used = std::min({scale, width_px / 640.0, height_px / 360.0});
    std::string picture;
    for (const char* page : kPages) {
        SCOPED_TRACE(page);
        const std::vector<SeenBox> boxes = load_boxes(folder_ / (std::string(page) + ".boxes"));
        check_boxes(boxes, width_px / used + 1, height_px / used + 1);
        const auto has = [&](const std::string& name) {
            return std::any_of(boxes.begin(), boxes.end(),
                               [&](const SeenBox& b) { return b.name == name; });
        };
        const auto begins = [&](const std::string& words) {
            return std::any_of(boxes.begin(), boxes.end(),
                               [&](const SeenBox& b) { return b.name.rfind(words, 0) == 0; });
        };
        // The script came where it meant to.
        if (page == std::string("class")) {
            EXPECT_TRUE(has("csv") && has("Ann Onymous"));
        }
        if (page == std::string("course")) {
            EXPECT_TRUE(has("module_first"));
            EXPECT_TRUE(has("option1") || width_px / used < 1200);  // else below, to be scrolled to
        }
        if (page == std::string("module") || page == std::string("locked")) {
            EXPECT_TRUE(has("begin"));
            // A small window has room for one module, and its question is scrolled to.
            if (width_px / used >= 1200) {
                EXPECT_TRUE(has("module_second") && !has("option1"));
            }
        }
        if (page == std::string("watched")) {  // the expert, and where the procedure stands
            EXPECT_TRUE(has("time"));
            if (width_px / used >= 1200) {
                EXPECT_TRUE(has(language == "C" ? "6 ml injected" : "6 ml eingespritzt"));
            }
        }
        if (page == std::string("marks")) {
            EXPECT_TRUE(has("save") && has("plus"));
        }
        if (page == std::string("settings")) {
            EXPECT_TRUE(has("Help") && has("Instructor"));
        }
        if (page == std::string("question")) {
            EXPECT_TRUE(has("option0") && has("option2") && has("later"));
        }
        if (page == std::string("asked")) {
            EXPECT_TRUE(has("option0"));
        }
        if (page == std::string("tray")) {
            EXPECT_TRUE(has("act0") && has("ask") && !has("option0"));
        }
        if (page == std::string("in_hand")) {
            EXPECT_TRUE(has("needle") && has("act0"));
        }
        // Task and hint are whole: check_boxes() would have found them cut.
        const bool english = language == "C";
        if ((page == std::string("hinted") || page == std::string("told")) &&
            width_px / used >= 1200) {
            EXPECT_TRUE(has(english ? "Numb the way down to the capsule, with all that is needed"
                                    : "Betäuben Sie den Weg bis zur Kapsel, mit allem, was dazu "
                                      "gehört"));
            EXPECT_TRUE(begins(english ? "The vessel beside" : "Das Gefäß neben"));
            EXPECT_EQ(begins(english ? "Inject at least 5 ml" : "Mindestens 5 ml"),
                      page == std::string("told") || height_px / used > 1000);
        }
        if (page == std::string("notices")) {
            EXPECT_TRUE(has("close") && !has("Help"));
        }
        if (page == std::string("longest") && width_px / used >= 1200) {
            EXPECT_TRUE(has("-30 dB"));
        }
        if (page == std::string("sign_in")) {
            EXPECT_TRUE(has("sign"));
        }
        for (const SeenBox& b : boxes) {
            if (b.kind != "picture" || b.name != "picture") continue;
            const std::string at = std::to_string(b.x) + " " + std::to_string(b.y) + " " +
                                   std::to_string(b.w) + " " + std::to_string(b.h);
            if (picture.empty()) picture = at;
            EXPECT_EQ(at, picture) << "the picture has moved";
        }
    }
    EXPECT_FALSE(picture.empty());
}

// All at once: a tour is mostly waiting for its next picture.
void check(std::initializer_list<Display> displays) {
    std::list<Tour> tours;
    for (const Display& display : displays) tours.emplace_back(display);
    for (Tour& tour : tours) tour.check();
}

// The layout is a function of the window's size divided by the scale (layout.h): these are the
// sizes that differ, 3840 x 2160 down to the least of 640 x 360, and one that comes out of
// rounding.
TEST(WindowBoxes, NothingOverlapsOrIsCutAt1280) {
    check({{"1280x720", 1}, {"1280x720", 1.5}, {"1280x720", 2}});
}

// Sanitizers see one size: the code is the same at all of them.
#ifndef __SANITIZE_ADDRESS__
TEST(WindowBoxes, NothingOverlapsOrIsCutAt1920) {
    check({{"1920x1080", 1}, {"1920x1080", 1.5}});
}

TEST(WindowBoxes, NothingOverlapsOrIsCutAt4K) {
    check({{"3840x2160", 1}, {"3840x2160", 1.5}});
}
#endif

TEST(WindowBoxes, GermanFitsAndIsWhole) {
    const char* const german = "de_DE.UTF-8";
    check({{"1280x720", 1, german}, {"960x600", 1, german}, {"1280x720", 2, german}});
}

}  // namespace
}  // namespace sonocase::runtime
