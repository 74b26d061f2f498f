// SPDX-License-Identifier: Apache-2.0

// Faults of the window that people met, each kept from coming back.
#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <set>
#include <sstream>
#include <thread>

#include "formats/base/mailbox.h"
#include "formats/files/load_save.h"
#include "formats/markers/camera_model.h"
#include "formats/progress_book/progress_book.h"
#include "formats/recording/session.h"
#include "runtime/player/ui/window_picture.h"
#include "runtime/tracking/devices/igtl_message.h"
#include "runtime/tracking/devices/socket.h"
#include "support/small_case.h"
#include "window_run.h"

namespace sonocase::runtime {
namespace {

using sonocase::testing::CommandResult;
using sonocase::testing::load_picture;
using sonocase::testing::Picture;
using sonocase::testing::read_text;

class WindowMended : public sonocase::testing::WindowRun {
  protected:
    WindowMended() : WindowRun(sonocase::testing::small_case(), "cylinder.sonocase") {}
    std::string command(const std::string& arguments, const std::string& script) {
        return WindowRun::command("--model paper " + arguments, script);
    }
    CommandResult run(const std::string& arguments, const std::string& script) {
        return in_display(command(arguments, script));
    }
    nlohmann::json settings() {
        return nlohmann::json::parse(read_text(folder_ / "config/sonocase/player.json"));
    }
    std::vector<SessionSample> samples(const std::string& file) {
        const auto sequence = load_sequence(file);
        if (!sequence) return {};
        const auto session = session_from_sequence(*sequence, guess_names(*sequence), file);
        return session ? session->samples : std::vector<SessionSample>{};
    }
};

TEST_F(WindowMended, ControlAndEqualChangeTheWordsAndNotTheGain) {
    ASSERT_EQ(run("", "wait 4\nhold = 20 ctrl\nwait 2\n" + shot("words") + "quit\n").status, 0);
    EXPECT_TRUE(says("words", " 0 dB\n"));
    EXPECT_GT(settings()["ui_scale"].get<double>(), 1.05);
    ASSERT_EQ(run("--ui-scale 1", "wait 4\nhold = 20\nwait 2\n" + shot("gain") + "quit\n").status,
              0);
    EXPECT_FALSE(says("gain", " 0 dB\n"));
}

// Neither another exercise nor another day begins with what was set for this one.
TEST_F(WindowMended, AnExerciseOpensAtGainZero) {
    ASSERT_EQ(run("", "wait 4\nhold = 20\nwait 2\n" + shot("set") + "key f5\nwait 4\n" +
                          shot("next") + "quit\n")
                  .status,
              0);
    EXPECT_FALSE(says("set", " 0 dB\n"));
    EXPECT_TRUE(says("next", " 0 dB\n"));
    ASSERT_EQ(run("", "wait 4\n" + shot("later") + "quit\n").status, 0);
    EXPECT_TRUE(says("later", " 0 dB\n"));
}

// A session that ends, or a system that shuts down.
TEST_F(WindowMended, SigtermKeepsTheSettings) {
    const std::string picture = folder_ / "now.png";
    const std::string line = command("", "wait 4\nhold = 30 ctrl\nwait 2\n" + shot("now"));
    const CommandResult result = in_display(line + " &\nplayer=$!\nuntil [ -e " + picture +
                                            " ]; do :; done\nkill -TERM $player\nwait $player");
    EXPECT_EQ(result.status, 0) << result.error;
    EXPECT_GT(settings()["ui_scale"].get<double>(), 1.05);
}

// What was measured in one picture says nothing about the next.
TEST_F(WindowMended, CalipersEndWithTheirPicture) {
    ASSERT_EQ(run("", "wait 6\nkey space\nwait 2\n" + shot("before") +
                          "key m\nmove 560 300\ndown 0\nup 0\nmove 700 400\ndown 0\nup 0\n"
                          "key m\nmove 20 700\nwait 2\n" +
                          shot("measured") + "key space\nwait 2\nkey space\nwait 2\n" +
                          shot("after") + "quit\n")
                  .status,
              0);
    // Its words stand where the sector leaves the corner black.
    const auto words = [&](const char* name) {
        return load_picture(folder_ / (std::string(name) + ".png")).mean(330, 590, 440, 640);
    };
    EXPECT_GT(words("measured"), words("before") + 1);
    EXPECT_NEAR(words("after"), words("before"), 0.2);
}

// D moves the tip to the right on the screen, also where left and right are exchanged.
TEST_F(WindowMended, TheNeedleGoesWhereItsKeySays) {
    for (const bool flipped : {false, true}) {
        const std::string file = folder_ / (flipped ? "b.igs.mha" : "a.igs.mha");
        ASSERT_EQ(run("--record " + file, std::string("wait 4\n") + (flipped ? "key f\n" : "") +
                                              "key n\nhold w 40\nwait 2\nhold d 30\nwait 4\nquit\n")
                      .status,
                  0);
        // Pushing does not turn the needle, however many frames each key took: its direction at the
        // beginning and at the end, along the probe's x.
        std::vector<double> across;
        for (const SessionSample& sample : samples(file)) {
            if (!sample.needle_ok) continue;
            const Vector3 forward = sample.mannequin_from_needle.rotation * Vector3{0, 0, 1};
            across.push_back(dot(sample.mannequin_from_probe.rotation.column(0), forward));
        }
        ASSERT_GT(across.size(), 2u);
        const double by = across.back() - across.front();
        EXPECT_GT(flipped ? -by : by, 0.02) << flipped;  // 30 x 1/60 s x 0.35 rad/s at an angle
    }
}

TEST_F(WindowMended, EveryDepthOfTheDepthGainHasItsOwnNumber) {
    ASSERT_EQ(run("", "wait 4\nkey ]\nkey ]\nkey ]\nwait 4\n" + shot("scan") + "quit\n").status, 0);
    std::set<std::string> numbers;
    std::istringstream lines(read_text(folder_ / "scan.png.boxes"));
    for (std::string line; std::getline(lines, line);) {
        const std::size_t cm = line.rfind(" cm");
        if (line.rfind("words", 0) == 0 && cm == line.size() - 3 && line.find('.') < cm)
            numbers.insert(line.substr(line.rfind(' ', cm - 1)));
    }
    EXPECT_GE(numbers.size(), 8u);
}

// Letters that a font lacks all look the same; these do not.
TEST_F(WindowMended, LettersBeyondLatin1AreShown) {
    for (const char* letters : {"ŁŁŁŁ", "ΩΩΩΩ", "ЖЖЖЖ", "ŻŻŻŻ"}) {
        std::string exercise = sonocase::testing::small_exercise_toml();
        const std::string title = "Find the vessel";
        exercise.replace(exercise.find(title), title.size(), letters);
        folder_.write("own.toml", exercise);
        ASSERT_EQ(run("--exercise " + (folder_ / "own.toml"), "wait 4\n" + shot(letters) + "quit\n")
                      .status,
                  0);
    }
    const auto title = [&](const char* letters) {
        return load_picture(folder_ / (std::string(letters) + ".png"));
    };
    const Picture first = title("ŁŁŁŁ");
    ASSERT_EQ(first.width, 1280);
    EXPECT_GT(first.mean(18, 58, 80, 82), 20);
    for (const char* other : {"ΩΩΩΩ", "ЖЖЖЖ", "ŻŻŻŻ"})
        EXPECT_GT(first.difference(title(other), 18, 58, 80, 82, 40), 0.03) << other;
}

// What is said stands in the top bar, in words, and can be read again later; it moves nothing.
TEST_F(WindowMended, ANoticeIsShownInTheTopBarAndKept) {
    ASSERT_EQ(
        run("", "wait 6\n" + shot("before") + "key f12\nwait 3\n" + shot("said") +
                    "press dismiss\nwait 2\n" + shot("after") +
                    "press settings\nwait 2\npress Notices\nwait 2\n" + shot("kept") + "quit\n")
            .status,
        0);
    const auto boxes = [&](const char* name) {
        return read_text(folder_ / (std::string(name) + ".png.boxes"));
    };
    EXPECT_EQ(boxes("before").find("Saved as"), std::string::npos);
    EXPECT_NE(boxes("said").find(" Saved as"), std::string::npos);
    EXPECT_NE(boxes("said").find(" notice\n"), std::string::npos);
    EXPECT_EQ(boxes("after").find("Saved as"), std::string::npos);
    EXPECT_NE(boxes("kept").find(" Saved as"), std::string::npos);
    // Its letters are light on the bar.
    const Picture said = load_picture(folder_ / "said.png"),
                  before = load_picture(folder_ / "before.png");
    EXPECT_GT(said.difference(before, 300, 4, 1100, 44, 60), 0.03);
}

// The curve of residuals while the probe pivots on a pin: in the accent colour, on the set-up.
TEST_F(WindowMended, TheSetUpShowsTheCourseOfTheResiduals) {
    std::string csv = "frame,timestamp_s,status,tx,ty,tz,r00,r01,r02,r10,r11,r12,r20,r21,r22\n";
    const Vector3 tip{10, -20, 150};
    for (int i = 0; i < 1200; ++i) {
        const double a = 0.011 * i, tilt = 0.6 * std::sin(0.037 * i);
        const Matrix3 r = rotation_about({std::cos(a), std::sin(a), 0}, tilt) *
                          rotation_about({0, 0, 1}, 0.3 * a);
        // The pin gives way by some millimetres, so that there is something to see.
        const Vector3 t = Vector3{100 + 3 * std::sin(0.5 * i), 50, 400} - r * tip;
        csv += std::to_string(i) + "," + std::to_string(0.02 * i) + ",OK";
        for (const double v : {t.x, t.y, t.z, r(0, 0), r(0, 1), r(0, 2), r(1, 0), r(1, 1), r(1, 2),
                               r(2, 0), r(2, 1), r(2, 2)})
            csv += "," + std::to_string(v);
        csv += "\n";
    }
    folder_.write("poses.csv", csv);
    ASSERT_EQ(run("--tracker replay:" + (folder_ / "poses.csv"),
                  "wait 6\nkey f3\nwait 3\npress next\nwait 3\n" + shot("step") +
                      "press record\nwait 400\n" + shot("course") + "quit\n")
                  .status,
              0);
    // Its curve: pixels of the accent colour in the upper half of the right column, beside its bar
    // of time at the bottom and the fields of the tilts.
    const auto accent = [&](const char* name) {
        const Picture picture = load_picture(folder_ / (std::string(name) + ".png"));
        int count = 0;
        for (int y = 150; y < 270 && picture.width == 1280; ++y) {
            for (int x = 960; x < 1250; ++x) {
                const std::uint8_t* p = &picture.rgb[3 * (static_cast<std::size_t>(y) * 1280 + x)];
                count += std::abs(p[0] - 0x82) < 24 && std::abs(p[1] - 0xC8) < 24 &&
                         std::abs(p[2] - 0xE0) < 24;
            }
        }
        return count;
    };
    EXPECT_EQ(accent("step"), 0);
    EXPECT_GT(accent("course"), 300);
}

TEST_F(WindowMended, TheSetUpOpensOverAResultAndLeadsBackToIt) {
    ASSERT_EQ(run("", "wait 6\nkey b\nwait 20\nkey b\nwait 6\n" + shot("result") +
                          "key f3\nwait 4\n" + shot("set_up") + "key f3\nwait 4\n" + shot("back") +
                          "key f3\nwait 4\nkey escape\nwait 4\n" + shot("escaped") + "quit\n")
                  .status,
              0);
    EXPECT_TRUE(says("set_up", "Tracker") && says("set_up", "scanning"));
    for (const char* page : {"result", "back", "escaped"}) {
        EXPECT_TRUE(says(page, "replay")) << page;
        EXPECT_FALSE(says(page, "scanning")) << page;
    }
}

// A stream whose names say nothing: the set-up lists them, a click gives one its tool, and the
// player keeps it.
TEST_F(WindowMended, TheSetUpListsTheNamesThatWereHeardAndGivesThemTools) {
    Result<Socket> server = Socket::listen("127.0.0.1", 0);
    ASSERT_TRUE(server);
    std::atomic<bool> over{false};
    std::thread sender([&] {
        Socket client = server->accept(60);
        Event pace;
        for (int i = 0; !over && client.open(); ++i) {
            for (const char* name : {"AlphaToTracker", "BetaToTracker", "GammaToTracker"})
                if (client.write(igtl::encode_transform(name, 1, {{}, {0.01 * i, 20, 300}})) < 0)
                    client.close();
            pace.wait(0.02);
        }
    });
    const std::string arguments =
        "--tracker igtl:127.0.0.1:" + std::to_string(server->port()) + " --ui-scale 1";
    const CommandResult result =
        run(arguments, "wait 90\nkey f3\nwait 20\n" + shot("heard") + "press probe-4\nwait 30\n" +
                           shot("given") + "quit\n");
    over = true;
    sender.join();
    ASSERT_EQ(result.status, 0) << result.error;
    for (const char* name : {"AlphaToTracker", "BetaToTracker", "GammaToTracker"})
        EXPECT_TRUE(says("heard", name)) << name;
    EXPECT_EQ(settings()["tools"], (std::vector<std::string>{"probe=BetaToTracker"}));
    EXPECT_EQ(settings()["probe_sensor"], 0);  // of devices with numbers
}

std::size_t sessions_in(const std::string& book) {
    auto opened = ProgressBook::open(book);
    if (!opened) return 99;
    auto sessions = opened->sessions("", "");
    return sessions ? sessions->size() : 99;
}

// A slip of the hand is not an attempt: it is scored, but not put into the book. Six pictures are
// over in time on a machine that needs half a second for one, and 260 never take less than 4 s.
TEST_F(WindowMended, AnAttemptOfASecondIsNotPutIntoTheBook) {
    ASSERT_EQ(run("--trainee Ann", "wait 6\nkey b\nwait 4\nkey b\nwait 4\nquit\n").status, 0);
    EXPECT_EQ(sessions_in(folder_ / "data/sonocase/progress.sqlite"), 0u);
    ASSERT_EQ(run("--trainee Ann", "wait 6\nkey b\nwait 260\nkey b\nwait 4\nquit\n").status, 0);
    EXPECT_EQ(sessions_in(folder_ / "data/sonocase/progress.sqlite"), 1u);
}

// A script of 2 s in an attempt of at least 3.3 s: it stays where it ends, and so does the needle.
TEST_F(WindowMended, AScriptStandsAtItsEndInAnAttempt) {
    const std::string file = folder_ / "script.igs.mha";
    ASSERT_EQ(run("--tracker sweep:along --record " + file, "wait 200\nquit\n").status, 0);
    const std::vector<SessionSample> recorded = samples(file);
    ASSERT_GT(recorded.size(), 2u);
    const auto way_mm = [&](const SessionSample& sample) {
        return norm(sample.mannequin_from_probe.translation -
                    recorded.front().mannequin_from_probe.translation);
    };
    double farthest_mm = 0;
    for (const SessionSample& sample : recorded) {
        EXPECT_GE(way_mm(sample), farthest_mm - 1) << sample.time_s;
        farthest_mm = std::max(farthest_mm, way_mm(sample));
    }
    EXPECT_GT(farthest_mm, 10);
    EXPECT_GT(recorded.back().time_s - recorded.front().time_s, 2.5);
}

// The needle goes in while the picture is frozen: what it does is recorded, as not seen.
TEST_F(WindowMended, AnAttemptIsRecordedBehindAFrozenPicture) {
    const std::string file = folder_ / "frozen.igs.mha";
    ASSERT_EQ(run("--tracker mouse --record " + file,
                  "wait 30\nkey n\nwait 10\nkey space\nwait 10\nhold w 90\nwait 10\n"
                  "key space\nwait 20\nquit\n")
                  .status,
              0);
    const std::vector<SessionSample> recorded = samples(file);
    const auto unseen = [](const SessionSample& sample) { return sample.unseen; };
    const auto first = std::find_if(recorded.begin(), recorded.end(), unseen),
               end = std::find_if_not(first, recorded.end(), unseen);
    ASSERT_TRUE(first != recorded.begin() && first != recorded.end() && end != recorded.end());
    EXPECT_TRUE(std::none_of(end, recorded.end(), unseen));
    const auto way_mm = [](const SessionSample& a, const SessionSample& b) {
        return norm(a.mannequin_from_needle.translation - b.mannequin_from_needle.translation);
    };
    EXPECT_GT(way_mm(*first, *std::prev(end)), 10);
    EXPECT_LT(way_mm(*std::prev(end), *end), 1);
    for (auto sample = std::next(first); sample != end; ++sample)
        EXPECT_LT(sample->time_s - std::prev(sample)->time_s, 1) << sample->time_s;
}

// A long title is shown on two lines where it is read, and with an ellipsis elsewhere; no letter is
// cut in two.
TEST_F(WindowMended, ALongTitleEndsInAnEllipsisAndNothingElseMoves) {
    std::string title;
    for (int i = 0; i < 12; ++i) title += "Überlänge " + std::to_string(i) + " ";
    std::string exercise = sonocase::testing::small_exercise_toml();
    const std::string before = "Find the vessel";
    exercise.replace(exercise.find(before), before.size(), title);
    folder_.write("long.toml", exercise);
    ASSERT_EQ(run("--exercise " + (folder_ / "long.toml"),
                  "wait 6\n" + shot("scan") + "key f8\nwait 3\n" + shot("exercises") +
                      "key f8\nkey b\nwait 20\nkey b\nwait 4\n" + shot("after") + "quit\n")
                  .status,
              0);
    for (const char* name : {"scan", "exercises", "after"}) {
        std::istringstream lines(read_text(folder_ / (std::string(name) + ".png.boxes")));
        int controls = 0;
        for (std::string line; std::getline(lines, line);) {
            std::istringstream fields(line);
            std::string kind;
            int layer = 0, cut = 0;
            double x = 0, y = 0, w = 0, h = 0;
            fields >> kind >> layer >> x >> y >> w >> h >> cut;
            EXPECT_EQ(cut, 0) << name << ": " << line;
            EXPECT_LE(x + w, 1281) << name << ": " << line;
            controls += kind == "control";
        }
        EXPECT_GT(controls, 3) << name;
    }
}

// Another tracker that is not there: the picture says so instead of looking live.
TEST_F(WindowMended, AnAbsentTrackerIsSaidOnThePicture) {
    ASSERT_EQ(
        run("", "wait 6\n" + shot("mouse") + "key f7 shift\nwait 90\n" + shot("absent") + "quit\n")
            .status,
        0);
    const std::string before = read_text(folder_ / "mouse.png.boxes"),
                      after = read_text(folder_ / "absent.png.boxes");
    EXPECT_EQ(before.find(" NO TRACKER\n"), std::string::npos);
    EXPECT_NE(after.find(" NO TRACKER\n"), std::string::npos) << after;
    EXPECT_LT(load_picture(folder_ / "absent.png").mean(400, 150, 900, 250),
              0.6 * load_picture(folder_ / "mouse.png").mean(400, 150, 900, 250) + 8);
}

// Where nothing is asked of a needle, none is spoken of until one is taken.
TEST_F(WindowMended, TheCardOfAScanSaysNothingOfNeedles) {
    CaseBundle bundle = sonocase::testing::small_case();
    std::string& toml = bundle.exercises.front().toml;
    toml.replace(toml.find("\"vascular\""), 10, "\"scan\"");
    ASSERT_TRUE(save_bundle(bundle, bundle_));
    ASSERT_EQ(run("", "wait 6\nkey b\nwait 6\n" + shot("scan") + "key n\nwait 6\n" +
                          shot("needle") + "quit\n")
                  .status,
              0);
    EXPECT_FALSE(says("scan", "Skin punctures") || says("scan", "Tip in view"));
    EXPECT_TRUE(says("needle", "Skin punctures") && says("needle", "Tip in view"));
}

// They come in the place of a question, which waits, also where the card has little room; an exam
// gives none and keeps its question.
TEST_F(WindowMended, HintsOfAProcedureAreRead) {
    CaseBundle bundle = sonocase::testing::small_case();
    std::string toml = sonocase::testing::small_procedure_toml();
    toml.insert(toml.find("kind ="),
                "hints = [\"Slide to the dark ring.\", \"Press, and it "
                "gives way: that tells a vein from the artery beside it.\"]\n");
    bundle.exercises.push_back({"line", toml});
    toml.insert(toml.find("kind ="), "mode = \"exam\"\n");
    toml.replace(toml.find("\"line\""), 6, "\"exam\"");
    bundle.exercises.push_back({"exam", toml});
    ASSERT_TRUE(save_bundle(bundle, bundle_));
    ASSERT_EQ(run("--exercise line", "wait 6\nkey b\nwait 6\n" + shot("asked") + "key h\nwait 6\n" +
                                         shot("first") + "key h\nwait 6\n" + shot("second") +
                                         "press ask\nwait 6\npress option1\n" + "wait 20\n" +
                                         shot("answered") + "quit\n")
                  .status,
              0);
    EXPECT_TRUE(says("asked", "What is below the skin?"));
    EXPECT_FALSE(says("first", "What is below the skin?"));
    EXPECT_TRUE(says("first", "Slide to the dark ring.") && says("first", " ask\n"));
    EXPECT_TRUE(says("second", "tells a vein"));
    EXPECT_TRUE(says("answered", "tells a vein"));
    EXPECT_FALSE(says("answered", " ask\n"));
    ASSERT_EQ(
        run("--exercise exam", "wait 6\nkey b\nwait 6\nkey h\nwait 6\n" + shot("exam") + "quit\n")
            .status,
        0);
    EXPECT_TRUE(says("exam", "What is below the skin?"));
    EXPECT_FALSE(says("exam", "Slide to the dark ring."));
}

// A second F5 leaves, the first only asks.
TEST_F(WindowMended, ChangingTheExerciseDuringAnAttemptAsksFirst) {
    ASSERT_EQ(run("", "wait 6\nkey b\nwait 6\nkey f5\nwait 3\n" + shot("asked") +
                          "key q ctrl\nwait 3\n" + shot("still") + "quit\n")
                  .status,
              0);
    const std::string asked = read_text(folder_ / "asked.png.boxes");
    EXPECT_NE(asked.find("An attempt is running."), std::string::npos);
    EXPECT_NE(asked.find(" hint\n"), std::string::npos);  // the attempt goes on
}

#ifdef SONOCASE_PRELOADED_VIDEO
// The tracker panel lists cameras by their names and lenses by their files; a camera keeps the lens
// that was chosen for it, and another one does not take it over.
TEST_F(WindowMended, ACameraKeepsTheLensThatWasChosenForIt) {
    std::filesystem::create_directories(folder_ / "data/sonocase/cases");
    CameraSetup setup;
    setup.camera = assumed_camera(1280, 720);
    setup.camera.rms_px = 0.1, setup.camera.sigma_focal_px = 1, setup.camera.pictures = 20;
    for (const char* name : {"arm", "desk"})
        folder_.write("data/sonocase/cases/" + std::string(name) + ".camera.json",
                      format_camera(setup));
    const std::string lens = folder_ / "data/sonocase/cases/desk.camera.json";
    const auto click = [](int y) {
        return "move 640 " + std::to_string(y) + "\nwait 2\ndown 0\nwait 2\nup 0\nwait 6\n";
    };
    // Rows of the open panel: the tracker, the lens, and what their lists show below them.
    constexpr int kTracker = 166, kLens = 244, kDesk = 298, kArm = 328, kDeskLens = 346;
    const auto chosen = [&](const std::string& clicks) {
        const CommandResult result =
            in_display("LD_PRELOAD=" SONOCASE_PRELOADED_VIDEO " " +
                       command("--ui-scale 1", "wait 6\nkey f9\nwait 6\n" + clicks + "quit\n"));
        EXPECT_EQ(result.status, 0) << result.error;
        return settings()["tracker"].get<std::string>();
    };
    const std::string desk = click(kTracker) + click(kDesk), arm = click(kTracker) + click(kArm);
    const std::string lens_of_desk = click(kLens) + click(kDeskLens);
    EXPECT_EQ(chosen(desk), "camera:3");
    EXPECT_EQ(chosen(lens_of_desk + arm), "camera:5");
    EXPECT_EQ(chosen(desk + lens_of_desk + arm + desk), "camera:3," + lens);
}
#endif

}  // namespace
}  // namespace sonocase::runtime
