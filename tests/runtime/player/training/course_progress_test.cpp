// SPDX-License-Identifier: Apache-2.0

#include "runtime/player/app/find_courses.h"

#include <gtest/gtest.h>

#include "formats/scoring/course_standing.h"
#include "formats/scoring/draw_attempt.h"
#include "runtime/player/app/class_records.h"
#include "support/temporary_folder.h"

namespace sonocase::runtime {
namespace {

Course two_modules() {
    Course course;
    course.name = "two";
    CourseModule first, second;
    first.name = "first";
    first.case_name = second.case_name = "demo";
    first.exercise = "look";
    first.options = {"a", "b"};
    first.measure = "needle_in_beam_fraction";
    first.at_least = 0.6;
    first.gate.passes_in_a_row = 2;
    first.retention_days = 30;
    second.name = "second";
    second.exercise = "puncture";
    second.gate = {.passes_in_a_row = 1, .exam = true};
    course.modules = {first, second};
    return course;
}

ProgressEntry attempt(const std::string& exercise, const std::string& started, bool passed) {
    ProgressEntry entry;
    entry.case_name = "demo";
    entry.exercise = exercise;
    entry.started = started;
    entry.passed = passed;
    entry.metrics = {{"needle_in_beam_fraction", passed ? 0.7 : 0.2}};
    return entry;
}

TEST(CourseStanding, FollowsAttemptsThroughGatesAndDates) {
    const Course course = two_modules();
    std::vector<ProgressEntry> history;
    CourseStanding now = course_standing(course, history, {}, "2026-03-01T10:00:00Z");
    EXPECT_EQ(now.next, 0);
    EXPECT_TRUE(now.modules[0].open);
    EXPECT_FALSE(now.modules[1].open);

    history.push_back(attempt("look", "2026-02-26T10:00:00Z", true));
    history.push_back(attempt("look", "2026-02-26T11:00:00Z", false));
    now = course_standing(course, history, {}, "2026-03-01T10:00:00Z");
    EXPECT_FALSE(now.modules[0].passed);
    EXPECT_EQ(now.modules[0].measured, 0.2);
    EXPECT_FALSE(now.modules[0].in_limits);
    history.push_back(attempt("look", "2026-02-27T10:00:00Z", true));
    // One that was made easier does not count.
    history.push_back(attempt("look", "2026-02-27T11:00:00Z", true));
    history.back().seed = seed_with_difficulty(5, kEasiest);
    EXPECT_FALSE(course_standing(course, history, {}, "2026-03-01").modules[0].passed);
    history.push_back(attempt("look", "2026-02-28T10:00:00Z", true));
    now = course_standing(course, history, {}, "2026-03-01T10:00:00Z");
    EXPECT_TRUE(now.modules[0].passed);
    EXPECT_TRUE(now.modules[0].in_limits);
    EXPECT_EQ(now.modules[0].passed_on, "2026-02-28");
    EXPECT_EQ(now.modules[0].due_on, "2026-03-30");  // over the end of February
    EXPECT_FALSE(now.modules[0].due);
    EXPECT_EQ(now.next, 1);
    EXPECT_TRUE(now.modules[1].open);

    // Practice does not open an exam's gate.
    history.push_back(attempt("puncture", "2026-03-02T10:00:00Z", true));
    EXPECT_FALSE(course_standing(course, history, {}, "2026-03-03").modules[1].passed);
    history.back().exam = true;
    now = course_standing(course, history, {}, "2026-03-03");
    EXPECT_TRUE(now.modules[1].passed);
    EXPECT_EQ(now.passed, 2);
    EXPECT_EQ(now.next, -1);

    // The day comes; a failure leaves it due, a pass does not.
    now = course_standing(course, history, {}, "2026-03-30T00:00:01Z");
    EXPECT_TRUE(now.modules[0].due);
    EXPECT_EQ(now.next, 0);
    history.push_back(attempt("look", "2026-04-01T10:00:00Z", false));
    EXPECT_TRUE(course_standing(course, history, {}, "2026-04-02").modules[0].due);
    history.push_back(attempt("look", "2026-04-03T10:00:00Z", true));
    now = course_standing(course, history, {}, "2026-04-04");
    EXPECT_FALSE(now.modules[0].due);
    EXPECT_EQ(now.modules[0].kept_on, "2026-04-03");
}

TEST(CourseStanding, SteadyByCusumOpensAGateToo) {
    Course course = two_modules();
    course.modules[0].gate = {.passes_in_a_row = 20, .steady = true};
    std::vector<ProgressEntry> history;
    int passes = 0;
    while (!course_standing(course, history, {}, "2026-03-30").modules[0].passed) {
        ASSERT_LT(passes, 20);
        ++passes;
        history.push_back(attempt("look", "2026-02-" + std::to_string(9 + passes), true));
    }
    EXPECT_EQ(passes, 8);  // as kSteadyCusum says
    EXPECT_EQ(course_standing(course, history, {}, "2026-03-30").modules[0].passed_on,
              "2026-02-17");
}

TEST(CourseStanding, KnowsAnswersOfThisCourseAlone) {
    const std::vector<CourseAnswer> answers{
        {"Ada", "other", "first", 0}, {"Ada", "two", "first", 1}, {"Ada", "two", "second", 0}};
    const CourseStanding now = course_standing(two_modules(), {}, answers, "2026-03-30");
    EXPECT_EQ(now.modules[0].option, 1);
    EXPECT_EQ(now.modules[1].option, -1);  // asks nothing
}

TEST(ClassRecords, HoldTheCourseOfEachTraineeAndChecklists) {
    std::vector<ProgressEntry> entries{attempt("look", "2026-02-26T10:00:00Z", true),
                                       attempt("look", "2026-02-26T11:00:00Z", true),
                                       attempt("look", "2026-02-26T12:00:00Z", false)};
    entries[0].trainee = entries[1].trainee = "Ada";
    entries[2].trainee = "Bob";
    entries[0].items = {{"found", true, true}, {"numbed", false, false}};
    entries[1].items = {{"found", true, true}, {"numbed", false, true}};
    entries[2].items = {{"found", true, false}, {"numbed", false, false}};
    const Course course = two_modules();
    const ClassRecords records = make_class_records(entries, {}, &course, "2026-03-01");
    EXPECT_EQ(records.course.at("Ada").passed, 1);
    EXPECT_EQ(records.course.at("Bob").passed, 0);
    EXPECT_TRUE(make_class_records(entries).course.empty());
    const auto ada = records.checklist("Ada", {"demo", "look"});
    ASSERT_EQ(ada.size(), 2u);
    EXPECT_EQ(ada[1].name, "numbed");
    EXPECT_EQ(ada[1].ticked, 1);
    EXPECT_EQ(ada[1].attempts, 2);
    EXPECT_TRUE(ada[1].last);
    EXPECT_TRUE(ada[0].critical);
    const auto all = records.checklist("", {"demo", "look"});
    EXPECT_EQ(all[0].ticked, 2);
    EXPECT_EQ(all[0].attempts, 3);
    EXPECT_FALSE(all[0].last);
    EXPECT_TRUE(records.checklist("Ada", {"demo", "puncture"}).empty());
    EXPECT_NE(xapi_json(entries).find("xapi/item/numbed\": true"), std::string::npos);
}

TEST(Courses, OneThatCannotBeReadIsSaidWithItsLine) {
    const testing::TemporaryFolder folder;
    folder.write("course.toml", "name = \"x\"\n[[modules]]\nname = \"a\"\n");
    Notices notices;
    (void)find_courses(folder / "course.toml", notices);
    ASSERT_FALSE(notices.kept().empty());
    EXPECT_NE(notices.kept().front().text.find("course.toml:2"), std::string::npos);
}

}  // namespace
}  // namespace sonocase::runtime
