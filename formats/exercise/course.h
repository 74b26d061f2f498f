// SPDX-License-Identifier: Apache-2.0

// A course: modules in order, each with a question before it, a short text, an expert to watch,
// practice on one measure, a gate to the next module and a date at which it is checked again. Read
// from TOML (course.toml, docs/procedures.md). What a trainee has of it is worked out from the
// progress book (formats/scoring/course_standing.h).
#pragma once

#include <cmath>
#include <string>
#include <string_view>
#include <vector>

#include "formats/base/result.h"

namespace sonocase {

// What opens the way to the next module: attempts at the module's exercise, as hard as it is
// written or harder. Where both rules are given, either does.
struct CourseGate {
    int passes_in_a_row = 0;  // 0: does not count
    bool steady = false;      // by learning-curve CUSUM
    bool exam = false;        // attempts at practice do not count
};

struct CourseModule {
    std::string name, title, text;
    std::string case_name, exercise;
    std::string expert;  // a sweep of the exercise; empty: nobody to watch
    // Asked before the text is shown.
    std::string question, because;  // because: said once it is answered
    std::vector<std::string> options;
    int answer = 0;
    // What to practise: one score and its limit. Empty: none.
    std::string measure;
    double at_most = INFINITY, at_least = -INFINITY;
    CourseGate gate;
    int retention_days = 0;  // after which a pass is asked for again; 0: never
};

struct Course {
    std::string name, title, text;
    std::vector<CourseModule> modules;  // at least one; names differ
    // In other languages: what differs from the course itself, by module.
    struct Texts {
        std::string language;  // ISO 639-1
        std::string title, text;
        struct Module {
            std::string title, text, question, because;
            std::vector<std::string> options;  // as many as the module has, or none
        };
        std::vector<Module> modules;  // # modules
    };
    std::vector<Texts> texts;
};

inline constexpr int kMaxModules = 32;

// `where` names the file in errors, which give the line too.
Result<Course> parse_course(std::string_view toml, const std::string& where);

// The course with all that it has in a language in the place of its own words.
Course course_in(const Course& course, std::string_view language);

}  // namespace sonocase
