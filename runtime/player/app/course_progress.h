// SPDX-License-Identifier: Apache-2.0

// Courses (formats/exercise/course.h) in the player: where they are found, and how a trainee stands
// in one, by the progress book.
#pragma once

#include <cmath>
#include <span>
#include <string>
#include <vector>

#include "formats/exercise/course.h"
#include "formats/progress_book/progress_book.h"
#include "runtime/player/app/notices.h"
#include "runtime/player/app/standing.h"

namespace sonocase::runtime::inline player_app {

// The courses in the folders in which cases are looked for: files that are called course.toml, or
// end in .course.toml; `given`, if any, comes first. One that cannot be read is left out, with a
// notice of its file and line; of two of the same name the first counts.
std::vector<Course> find_courses(const std::string& given, Notices& notices);

struct ModuleStanding {
    int option = -1;         // answered; -1: not yet
    bool open = false;       // the modules before it are passed
    Standing attempts;       // those that count for the gate
    double measured = NAN;   // the practised measure, in the last attempt
    bool in_limits = false;  // `measured` is
    bool passed = false;
    // Days as YYYY-MM-DD; empty: none.
    std::string passed_on, due_on, kept_on;
    bool due = false;  // the day has come, and no pass since
};

struct CourseStanding {
    std::vector<ModuleStanding> modules;  // # modules
    int passed = 0, due = 0;
    int next = -1;  // first the module that is due, then the first not passed; -1: none
};

// history: of the trainee, oldest first. today: as it begins an ISO 8601 time.
CourseStanding course_standing(const Course& course,
                               std::span<const ProgressEntry> history,
                               std::span<const CourseAnswer> answers,
                               const std::string& today);

}  // namespace sonocase::runtime::inline player_app
