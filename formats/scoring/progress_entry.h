// SPDX-License-Identifier: Apache-2.0

// What is kept of an attempt and of an answer, wherever it is kept: in the desktop's progress book
// or in a browser.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "formats/scoring/session_score.h"

namespace sonocase {

// An attempt with less elapsed time than this is a slip of the hand: it is scored and not kept.
inline constexpr double kMinAttemptS = 3;

// A line of a procedure's checklist as an attempt left it.
struct CheckedItem {
    std::string name;
    bool critical = false, ticked = false;
    friend bool operator==(const CheckedItem&, const CheckedItem&) = default;
};

struct ProgressEntry {
    std::int64_t id = 0;                                // given by the book
    std::string trainee, case_name, exercise, started;  // started: ISO 8601, UTC
    std::string recording;                              // path of the session file; empty: not kept
    bool passed = false;
    bool exam = false;               // no help was given
    std::uint64_t seed = 0;          // with which the attempt was drawn; 0: exercise as written
    std::vector<Metric> metrics;     // only those with a finite value
    std::vector<CheckedItem> items;  // of its procedure, in the order of the file
};

// What a trainee chose when a module of a course asked (formats/exercise/course.h).
struct CourseAnswer {
    std::string trainee, course, module;
    int option = 0;
    friend bool operator==(const CourseAnswer&, const CourseAnswer&) = default;
};

}  // namespace sonocase
