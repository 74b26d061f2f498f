// SPDX-License-Identifier: Apache-2.0

// An educator's own target as an exercise file, and the records of a class.
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <nlohmann/json.hpp>

#include "formats/files/load_save.h"
#include "runtime/player/app/attempt_steps.h"
#include "runtime/player/app/class_records.h"
#include "runtime/player/app/own_exercises.h"
#include "runtime/player/session/open_case.h"
#include "support/small_case.h"
#include "support/temporary_folder.h"

namespace sonocase::runtime {
namespace {

Exercise base() {
    auto exercise = parse_exercise(testing::small_exercise_toml(), "small");
    EXPECT_TRUE(exercise);
    return *exercise;
}

TEST(NewTarget, IsReadBackAsItWasPlacedWhateverTheTitleHolds) {
    Rigid pose;
    pose.rotation = rotation_about({1, 0, 0}, 3.0);
    pose.translation = {1.25, -20, 61.5};
    for (const std::string title :
         {"Dome lesion", "A \"quoted\" \\ title", "Läsion 3", "\n\t", "]"}) {
        const std::string toml = exercise_toml(base(), title, {10.25, -3.5, 30.75}, 7, pose);
        const auto read = parse_exercise(toml, "own");
        ASSERT_TRUE(read) << read.error().message() << "\n" << toml;
        ASSERT_EQ(read->targets.size(), 1u);
        EXPECT_NEAR(distance(read->targets[0].centre, Point3{10.25, -3.5, 30.75}), 0, 1e-9);
        EXPECT_EQ(read->targets[0].radius_mm, 7);
        EXPECT_NEAR(distance(read->start_probe, pose * Point3{0, 0, 0}), 0, 0.01);
        EXPECT_NEAR(dot(normalized(read->start_beam), pose.rotation * Vector3{0, 0, 1}), 1, 1e-6);
        EXPECT_NEAR(dot(start_pose(*read).rotation.column(0), pose.rotation.column(0)), 1, 1e-6);
        EXPECT_EQ(read->probe.shape, base().probe.shape);
        EXPECT_NEAR(read->probe.field_of_view_rad, base().probe.field_of_view_rad, 1e-5);
        EXPECT_GE(read->pass_marks.size(), 3u);
        for (const char c : read->name)
            EXPECT_TRUE(std::isalnum(static_cast<unsigned char>(c)) || c == '-') << read->name;
    }
    EXPECT_EQ(exercise_name("Dome lesion!"), "dome-lesion");
    EXPECT_EQ(exercise_name("../../etc"), "etc");
    EXPECT_EQ(exercise_name("***"), "own-target");
}

TEST(NewTarget, BesideTheCaseIsAmongItsExercises) {
    const testing::TemporaryFolder folder;
    const std::string path = folder / "case.sonocase";
    ASSERT_TRUE(save_bundle(testing::small_case(), path));
    std::filesystem::create_directories(path + ".exercises");
    folder.write("case.sonocase.exercises/a.toml",
                 exercise_toml(base(), "Own", {0, 0, 25}, 6, Rigid{}));
    folder.write("case.sonocase.exercises/b.toml",
                 exercise_toml(base(), "Outside", {0, 0, 500}, 6, Rigid{}));
    const auto open = open_case(path);
    ASSERT_TRUE(open);
    ASSERT_EQ((*open)->exercises.size(), 2u);
    EXPECT_EQ((*open)->exercises[1].title, "Own");
    EXPECT_EQ((*open)->exercise_files[1], path + ".exercises/a.toml");
    ASSERT_EQ((*open)->warnings.size(), 1u);  // the other says why it is left out
    EXPECT_NE((*open)->warnings[0].find("outside the body"), std::string::npos);
}

ProgressEntry attempt(const char* trainee, const char* exercise, bool passed, double mm) {
    ProgressEntry entry;
    entry.trainee = trainee;
    entry.case_name = "torso";
    entry.exercise = exercise;
    entry.started = "2026-01-02T03:04:05Z";
    entry.passed = passed;
    entry.metrics = {{"final_tip_to_target_mm", mm}};
    return entry;
}

TEST(ClassRecords, SayWhoStandsWhereAndWhoNeedsHelp) {
    const ClassRecords records =
        make_class_records({attempt("B", "liver", false, 20), attempt("B", "liver", false, 18),
                            attempt("A", "liver", true, 4), attempt("A", "liver", true, 3),
                            attempt("A", "liver", true, 3), attempt("B", "liver", false, 15),
                            attempt("A", "kidney", false, 9)});
    EXPECT_EQ(records.trainees, (std::vector<std::string>{"A", "B"}));
    const ClassExercise kidney{"torso", "kidney"}, liver{"torso", "liver"};
    EXPECT_EQ(records.exercises, (std::vector<ClassExercise>{kidney, liver}));
    EXPECT_TRUE(records.standing("A", liver).mastered);
    EXPECT_EQ(records.standing("B", liver).attempts, 3);
    EXPECT_EQ(records.standing("B", kidney).attempts, 0);
    // The same exercise on another case is another one.
    EXPECT_EQ(records.standing("B", {"other", "liver"}).attempts, 0);
    EXPECT_EQ(records.curve("B", liver), (std::vector<double>{20, 18, 15}));
    EXPECT_EQ(records.help.trainee, "B");
    EXPECT_EQ(records.help.exercise, liver);
    EXPECT_EQ(records.help.attempts, 3);
}

// Statements carry what a learning record store requires (xAPI 1.0.3, 4.1): actor, verb, object.
TEST(Xapi, IsJsonWithOneStatementPerAttempt) {
    std::vector<ProgressEntry> entries = {attempt("J\xE4nsen \"x\"", "liver", true, 4),
                                          attempt("B", "kidney", false, 12.5)};
    const auto all = nlohmann::json::parse(xapi_json(entries));
    ASSERT_EQ(all.size(), 2u);
    EXPECT_EQ(all[0]["verb"]["id"], "http://adlnet.gov/expapi/verbs/passed");
    EXPECT_EQ(all[1]["verb"]["id"], "http://adlnet.gov/expapi/verbs/failed");
    EXPECT_EQ(all[1]["actor"]["account"]["name"], "B");
    EXPECT_EQ(all[1]["result"]["success"], false);
    EXPECT_EQ(all[1]["timestamp"], "2026-01-02T03:04:05Z");
    EXPECT_EQ(
        all[1]["result"]["extensions"]["https://sonocase.org/xapi/measure/final_tip_to_target_mm"],
        12.5);
    EXPECT_EQ(nlohmann::json::parse(xapi_json({})).size(), 0u);
}

TEST(StraightWay, HasBothEndsAndEvenSteps) {
    const auto way = straight_way({0, 0, 0}, {0, 0, 21});
    EXPECT_EQ(way.size(), 12u);
    EXPECT_EQ(way.front(), (Point3{0, 0, 0}));
    EXPECT_NEAR(distance(way.back(), Point3{0, 0, 21}), 0, 1e-12);
    EXPECT_EQ(straight_way({1, 1, 1}, {1, 1, 1}).size(), 2u);  // no way at all
}

}  // namespace
}  // namespace sonocase::runtime
