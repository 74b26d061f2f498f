// SPDX-License-Identifier: Apache-2.0

#include "runtime/player/app/attempt_steps.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <thread>

#include "formats/files/atomic_file.h"
#include "runtime/player/app/case_steps.h"
#include "runtime/player/app/tracker_steps.h"
#include "runtime/player/session/clock.h"
#include "support/small_case.h"
#include "support/temporary_folder.h"

namespace sonocase::runtime {
namespace {

TEST(TargetsReached, TheTipMarksATargetWithinItsRadiusAndTheMarkStays) {
    Exercise exercise;
    exercise.targets.resize(2);
    exercise.targets[0].hit_radius_mm = 3;
    exercise.targets[1].hit_radius_mm = 3;
    const std::vector<Point3> centres{{0, 0, 50}, {20, 0, 50}};
    std::vector<bool> reached(2, false);
    FrameRecord record;
    record.needle.mannequin_from_drawn.translation = {0, 0, 52};
    mark_targets_reached(exercise, record, centres, reached);
    EXPECT_FALSE(reached[0]);  // no needle
    record.tools.has_needle = true;
    mark_targets_reached(exercise, record, centres, reached);
    EXPECT_TRUE(reached[0]);
    EXPECT_FALSE(reached[1]);
    record.needle.mannequin_from_drawn.translation = {0, 0, 0};
    mark_targets_reached(exercise, record, centres, reached);
    EXPECT_TRUE(reached[0]);
}

// A needle anywhere is no step: first the target is seen, then the needle in its plane, then the
// tip near it; and what was done stays done.
TEST(Steps, AreThoseThatWereDone) {
    Exercise exercise;
    exercise.probe.shape = ProbeShape::linear;
    exercise.probe.width_mm = 60;
    exercise.probe.depth_mm = 80;
    std::vector<Point3> centres{{0, 20, 50}};  // beside the plane
    FrameRecord record;
    record.tools.has_probe = record.tools.has_needle = true;
    record.needle.depth_mm = 30;
    record.needle.mannequin_from_drawn = {Matrix3::from_columns({0, 0, -1}, {0, 1, 0}, {1, 0, 0}),
                                          {0, 0, 50}};
    StepsDone done;
    note_steps(exercise, nullptr, record, centres, done);
    EXPECT_FALSE(done.target_seen || done.needle_seen || done.tip_near);
    centres[0] = {0, 1, 50};
    record.needle.mannequin_from_drawn.translation = {-20, 10, 50};  // needle beside the plane
    note_steps(exercise, nullptr, record, centres, done);
    EXPECT_TRUE(done.target_seen);
    EXPECT_FALSE(done.needle_seen);
    record.needle.mannequin_from_drawn.translation = {-20, 0, 50};
    note_steps(exercise, nullptr, record, centres, done);
    EXPECT_TRUE(done.needle_seen);
    EXPECT_FALSE(done.tip_near);
    record.needle.mannequin_from_drawn.translation = {-10, 0, 50};
    note_steps(exercise, nullptr, record, centres, done);
    EXPECT_TRUE(done.tip_near);
    record.tools.has_needle = false;
    centres[0] = {0, 90, 50};
    note_steps(exercise, nullptr, record, centres, done);
    EXPECT_TRUE(done.target_seen && done.needle_seen && done.tip_near);
}

std::unique_ptr<OpenCase> small_open_case() {
    auto open = std::make_unique<OpenCase>();
    open->bundle = StreamedBundle(testing::small_case());
    Exercise exercise = testing::small_exercise();
    exercise.hints = {"Look.", "Look again."};
    open->exercises = {exercise};
    return open;
}

// An attempt that runs, without a window.
struct Running {
    testing::TemporaryFolder folder;
    PlayerState player;
    CaseState loaded;
    ScanState scan;
    Running() {
        loaded.open = small_open_case();
        EngineOptions options;
        options.render.width_px = options.render.height_px = 64;
        options.render.model = ImageModel::paper;
        auto engine = ScanEngine::create(loaded.open->bundle, loaded.exercise(), options);
        auto run = SessionRun::start(folder / "s.igs.mha", *loaded.open, *engine, "", "", 0);
        scan.training.attempt =
            std::make_shared<Attempt>(*loaded.open, loaded.exercise(), std::move(*run));
    }
};

TEST(LeavingAnAttempt, IsAskedAboutOnceAndTheAnswerHoldsForFourSeconds) {
    Running running;
    auto& [folder, player, loaded, scan] = running;
    player.now_s = 10;
    EXPECT_FALSE(may_leave_attempt(player, scan.training, "F5"));
    ASSERT_EQ(player.notices.standing().size(), 1u);
    EXPECT_NE(player.notices.standing()[0].text.find("F5"), std::string::npos);
    player.now_s = 12;
    EXPECT_TRUE(may_leave_attempt(player, scan.training, "F5"));
    EXPECT_FALSE(
        may_leave_attempt(player, scan.training, "Ctrl + Q"));  // another key is another question
    player.now_s = 30;
    EXPECT_FALSE(may_leave_attempt(player, scan.training, "F5"));
    scan.training.attempt.reset();
    EXPECT_TRUE(may_leave_attempt(player, scan.training, "F5"));  // nothing to lose
}

// One press of the same key that finishes practice does not end an exam.
TEST(EndingAnExam, IsAskedAboutOnce) {
    Running running;
    auto& [folder, player, loaded, scan] = running;
    scan.training.exam = true;
    player.now_s = 10;
    EXPECT_FALSE(toggle_attempt(player, loaded, scan));
    ASSERT_TRUE(scan.training.attempt);
    ASSERT_EQ(player.notices.standing().size(), 1u);
    EXPECT_NE(player.notices.standing()[0].text.find("exam"), std::string::npos);
    player.now_s = 30;  // too late to be the answer
    EXPECT_FALSE(toggle_attempt(player, loaded, scan));
    EXPECT_TRUE(scan.training.attempt);
}

TEST(Hints, ComeOneByOneThenTheTargetsAndNeverInAnExam) {
    Running running;
    auto& [folder, player, loaded, scan] = running;
    const Exercise& exercise = loaded.exercise();
    for (int shown = 0; shown <= 3; ++shown) {
        EXPECT_EQ(scan.training.hints_shown, shown);
        EXPECT_EQ(shows_targets(scan, exercise), shown == 3);
        show_next_hint(player.notices, loaded, scan.training);
    }
    EXPECT_EQ(scan.training.hints_shown, 3);
    scan.training.hints_shown = 0;
    loaded.open->exercises[0].mode = ExerciseMode::exam;
    for (int i = 0; i < 5; ++i) show_next_hint(player.notices, loaded, scan.training);
    EXPECT_FALSE(shows_targets(scan, exercise));
    scan.training.attempt.reset();
    EXPECT_TRUE(shows_targets(scan, exercise));  // free scanning
}

TEST(UnkeptRecording, GoesWithItsObject) {
    std::string path;
    {
        const UnkeptRecording recording;
        path = recording.path();
        ASSERT_FALSE(path.empty());
        ASSERT_TRUE(write_file(path, std::string_view("x")));
    }
    EXPECT_FALSE(std::filesystem::exists(path));
    EXPECT_FALSE(std::filesystem::exists(std::filesystem::path(path).parent_path()));
}

TEST(SavingCalibrations, WithNothingCalibratedKeepsWhatWasSaved) {
    Settings settings;
    settings.calibrations = {"/a/probe.json"};
    Notices notices;
    EXPECT_FALSE(save_calibrations({}, settings, notices));
    EXPECT_EQ(settings.calibrations.size(), 1u);
    ASSERT_EQ(notices.standing().size(), 1u);
    EXPECT_EQ(notices.standing()[0].text.find("Saved"), std::string::npos);
}

// After another tracker was chosen, nothing of the one before is shown as if it were live.
TEST(ChangingTheTracker, ForgetsWhatTheOneBeforeReported) {
    const auto open = small_open_case();
    EngineOptions options;
    options.render.width_px = options.render.height_px = 64;
    options.render.model = ImageModel::paper;
    auto engine = ScanEngine::create(open->bundle, open->exercises[0], options);
    ScanThread scan(session_clock(steady_seconds()));
    scan.set_engine(std::make_unique<ScanEngine>(std::move(*engine)));
    const auto mouse = std::make_shared<PushTracker>("Mouse");
    scan.set_tracker(mouse);
    TrackerReading reading;
    reading.sequence = 1;
    reading.in_mannequin = true;
    reading.sensor_count = 1;
    reading.sensors[0] = {SensorState::ok,
                          {Matrix3::from_columns({1, 0, 0}, {0, -1, 0}, {0, 0, -1}), {0, 0, 59}},
                          1,
                          0};
    mouse->push(reading);
    const auto wait_for = [&](const auto& condition) {
        const double give_up_s = steady_seconds() + 30;
        while (steady_seconds() < give_up_s) {
            if (scan.refresh() && condition(scan.frame())) return true;
            std::this_thread::yield();
        }
        return false;
    };
    ASSERT_TRUE(wait_for([](const ScanFrame& f) { return f.record.tools.has_probe; }));
    EXPECT_TRUE(scan.frame().reading.in_mannequin);
    EXPECT_FALSE(scan.frame().waiting);
    scan.set_tracker(std::make_shared<PushTracker>("Absent", true));
    ASSERT_TRUE(wait_for([](const ScanFrame& f) { return f.waiting; }));
    const ScanFrame& frame = scan.frame();
    EXPECT_FALSE(frame.reading.in_mannequin);
    EXPECT_EQ(frame.reading.sensor_count, 0);
    EXPECT_FALSE(frame.record.tools.has_probe);
    EXPECT_EQ(frame.probe_verdict, SensorVerdict::absent);
    EXPECT_EQ(std::count(frame.pixels.begin(), frame.pixels.end(), 0),
              static_cast<long>(frame.pixels.size()));
}

// What a script's saved picture waits for: a frame that is said to show some controls does, live
// and frozen, however fast they follow each other.
TEST(ControlsThatAreShown, AreThoseOfTheFrame) {
    const auto open = small_open_case();
    EngineOptions options;
    options.render.width_px = options.render.height_px = 64;
    options.render.model = ImageModel::paper;
    auto engine = ScanEngine::create(open->bundle, open->exercises[0], options);
    ScanThread scan(session_clock(steady_seconds()));
    scan.set_engine(std::make_unique<ScanEngine>(std::move(*engine)));
    ScanControls controls;
    for (int n = 1; n <= 30; ++n) {
        controls.settings.gain_db = n % 2 ? n : -n;
        controls.frozen = n > 15;
        scan.set_controls(controls);
        EXPECT_EQ(scan.controls_set(), static_cast<std::uint64_t>(n));
        const double give_up_s = steady_seconds() + 30;
        while (scan.controls_shown() < scan.controls_set() && steady_seconds() < give_up_s)
            std::this_thread::yield();
        scan.refresh();
        EXPECT_EQ(scan.frame().record.input.settings.gain_db, controls.settings.gain_db) << n;
        EXPECT_EQ(scan.frame().frozen, controls.frozen) << n;
    }
}

// The set-up's table: each click gives a sensor a role, in which it takes the place of another, or
// takes it away; a sensor without a name keeps it by its number, one with a name by that.
TEST(GivingARole, IsKeptByNumberOrByName) {
    PlayerState player;
    CaseState loaded;
    loaded.scan = std::make_unique<ScanThread>(session_clock(steady_seconds()));
    TrackerInUse tracker;
    tracker.spec = "viper";
    EXPECT_EQ(sensors_in_use(player, tracker), (SensorAssignment{0, 1, -1}));
    give_role(player, loaded, tracker, {}, 2, ToolOf::reference);
    EXPECT_EQ(sensors_in_use(player, tracker), (SensorAssignment{0, 1, 2}));
    give_role(player, loaded, tracker, {}, 2, ToolOf::probe);  // it cannot be both
    EXPECT_EQ(sensors_in_use(player, tracker), (SensorAssignment{2, 1, -1}));
    give_role(player, loaded, tracker, {}, 1, ToolOf::needle);  // taken away
    EXPECT_EQ(sensors_in_use(player, tracker), (SensorAssignment{2, -1, -1}));
    EXPECT_EQ(player.settings.probe_sensor, 2);
    // Names are of another kind of tracker, and numbers say nothing about them.
    tracker.spec = "igtl:127.0.0.1:18944";
    EXPECT_EQ(sensors_in_use(player, tracker), (SensorAssignment{0, 1, -1}));
    const std::vector<std::string> names{"", "", "StylusTipToTracker", "MarkerToTracker"};
    give_role(player, loaded, tracker, names, 2, ToolOf::needle);
    give_role(player, loaded, tracker, names, 3, ToolOf::reference);
    EXPECT_EQ(player.settings.tools,
              (std::vector<std::string>{"needle=StylusTipToTracker", "reference=MarkerToTracker"}));
    EXPECT_EQ(sensors_in_use(player, tracker), (SensorAssignment{0, 1, 2}));
    give_role(player, loaded, tracker, names, 3, ToolOf::needle);  // in the other's place
    EXPECT_EQ(player.settings.tools, (std::vector<std::string>{"needle=MarkerToTracker"}));
    give_role(player, loaded, tracker, names, 3, ToolOf::needle);
    EXPECT_TRUE(player.settings.tools.empty());
    tracker.spec = "viper";
    EXPECT_EQ(sensors_in_use(player, tracker), (SensorAssignment{2, -1, -1}));
    // What the command line says goes before, for this run.
    player.arguments.tools = {"needle=4"};
    EXPECT_EQ(sensors_in_use(player, tracker), (SensorAssignment{2, 3, -1}));
}

TEST(Cine, StepsThroughTheKeptFramesAndPlaysInARing) {
    Console console;
    step_cine(console, 1, 3);
    EXPECT_TRUE(console.controls.frozen);
    EXPECT_EQ(console.controls.cine_back, 1);
    step_cine(console, 5, 3);
    EXPECT_EQ(console.controls.cine_back, 2);
    console.cine.playing = true;
    for (int expected : {1, 0, 2}) {
        console.cine.last_step_s = 0;
        advance_cine(console, 3, 1);
        EXPECT_EQ(console.controls.cine_back, expected);
    }
    advance_cine(console, 3, 1 + 0.5 / kCineRate);  // before the next frame's time
    EXPECT_EQ(console.controls.cine_back, 2);
    set_frozen(console, false);
    EXPECT_EQ(console.controls.cine_back, 0);
    EXPECT_FALSE(console.cine.playing);
}

}  // namespace
}  // namespace sonocase::runtime
