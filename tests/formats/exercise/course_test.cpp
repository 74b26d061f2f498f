// SPDX-License-Identifier: Apache-2.0

#include "formats/exercise/course.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>

#include "formats/exercise/exercise.h"
#include "formats/files/atomic_file.h"
#include "support/paths.h"

namespace sonocase {
namespace {

const char* kCourse = R"(name = "two"
title = "Two modules"
[[modules]]
name = "first"
title = "First"
text = """
One line
and the next.

A paragraph."""
case = "demo"
exercise = "look"
expert = "needle"
question = "Which?"
options = ["This", "That"]
answer = 1
because = "So."
practice = { measure = "needle_in_beam_fraction", at_least = 0.6 }
gate = { passes_in_a_row = 2, steady = true }
retention_days = 30
[[modules]]
name = "second"
text = "Short."
case = "demo"
exercise = "puncture"
gate = { passes_in_a_row = 1, exam = true }
[texts.de]
title = "Zwei Module"
[[texts.de.modules]]
name = "first"
options = ["Dies", "Das"]
)";

TEST(Course, IsReadWithItsOtherLanguage) {
    const auto course = parse_course(kCourse, "course.toml");
    ASSERT_TRUE(course) << course.error().message();
    ASSERT_EQ(course->modules.size(), 2u);
    const CourseModule& first = course->modules[0];
    EXPECT_EQ(first.text, "One line and the next.\nA paragraph.");
    EXPECT_EQ(first.measure, "needle_in_beam_fraction");
    EXPECT_EQ(first.at_least, 0.6);
    EXPECT_EQ(first.gate.passes_in_a_row, 2);
    EXPECT_TRUE(first.gate.steady);
    EXPECT_EQ(first.retention_days, 30);
    EXPECT_EQ(course->modules[1].title, "second");
    EXPECT_TRUE(course->modules[1].gate.exam);
    const Course german = course_in(*course, "de");
    EXPECT_EQ(german.title, "Zwei Module");
    EXPECT_EQ(german.modules[0].options[1], "Das");
    EXPECT_EQ(german.modules[0].question, "Which?");
    EXPECT_EQ(course_in(*course, "fr").title, "Two modules");
}

TEST(Course, IsRefusedWithFileAndLineWhereItMakesNoSense) {
    const struct {
        const char *from, *to, *line, *says;
    } kFaults[] = {
        {"name = \"second\"", "name = \"first\"", "course.toml:22", "given twice"},
        {"answer = 1", "answer = 2", "course.toml:16", "no option"},
        {"answer = 1\n", "", "course.toml:3", "answer"},
        {"options = [\"This\", \"That\"]", "options = [\"This\"]", "course.toml:15", "1 texts"},
        {"question = \"Which?\"", "", "course.toml:15", "no question"},
        {"needle_in_beam_fraction", "needle_in_beam_fractoin", "course.toml:18",
         "needle_in_beam_fraction"},
        {", at_least = 0.6", "", "course.toml:18", "limit"},
        {"passes_in_a_row = 2, steady = true", "exam = true", "course.toml:19", "rule"},
        {"gate = { passes_in_a_row = 2, steady = true }", "", "course.toml:3", "gate"},
        {"retention_days = 30", "retention_days = 0", "course.toml:20", "1"},
        {"exercise = \"look\"\n", "", "course.toml:3", "exercise"},
        {"text = \"Short.\"", "text = \"\"", "course.toml:23", "empty"},
        {"options = [\"Dies\", \"Das\"]", "options = [\"Dies\"]", "course.toml:31", "2"},
        {"[[texts.de.modules]]\nname = \"first\"", "[[texts.de.modules]]\nname = \"frist\"",
         "course.toml:30", "first"},
        {"expert = \"needle\"", "export = \"needle\"", "course.toml:13", "expert"},
    };
    for (const auto& fault : kFaults) {
        std::string text = kCourse;
        const std::size_t at = text.find(fault.from);
        ASSERT_NE(at, std::string::npos) << fault.from;
        text.replace(at, std::string(fault.from).size(), fault.to);
        const auto course = parse_course(text, "course.toml");
        ASSERT_FALSE(course) << fault.from;
        const std::string message = course.error().message();
        EXPECT_NE(message.find(fault.line), std::string::npos) << fault.from << ": " << message;
        EXPECT_NE(message.find(fault.says), std::string::npos) << fault.from << ": " << message;
    }
    EXPECT_FALSE(parse_course("name = \"none\"", "course.toml"));
}

// The course that comes with the program: what it names is there, and German is whole.
TEST(Course, TheOneAtHandNamesExercisesAndExpertsThatExist) {
    const std::string scenarios = SONOCASE_SOURCE "/scenarios/";
    const auto text = read_text_file(scenarios + "course/course.toml");
    ASSERT_TRUE(text);
    const auto course = parse_course(*text, "course.toml");
    ASSERT_TRUE(course) << course.error().message();
    for (const CourseModule& m : course->modules) {
        const auto toml = read_text_file(scenarios + m.case_name + "/" + m.exercise + ".toml");
        ASSERT_TRUE(toml) << m.name;
        EXPECT_NE(read_text_file(scenarios + m.case_name + "/case.toml")->find("\"" + m.exercise),
                  std::string::npos)
            << m.name;
        // Read as it stands; cooking carries places to the mannequin.
        std::string own = *toml;
        const std::string frame = "frame = \"ct\"";
        own.replace(own.find(frame), frame.size(), "");
        const auto exercise = parse_exercise(own, m.exercise);
        ASSERT_TRUE(exercise) << exercise.error().message();
        EXPECT_TRUE(std::any_of(exercise->sweeps.begin(), exercise->sweeps.end(),
                                [&](const Sweep& sweep) { return sweep.name == m.expert; }))
            << m.name;
    }
    ASSERT_EQ(course->texts.size(), 1u);
    EXPECT_EQ(course->texts[0].language, "de");
    for (const Course::Texts::Module& m : course->texts[0].modules) {
        EXPECT_FALSE(m.title.empty());
        EXPECT_FALSE(m.text.empty()) << m.title;
        EXPECT_FALSE(m.question.empty()) << m.title;
        EXPECT_FALSE(m.because.empty()) << m.title;
        EXPECT_FALSE(m.options.empty()) << m.title;
    }
}

}  // namespace
}  // namespace sonocase
