// SPDX-License-Identifier: Apache-2.0

// What the page after an attempt says, in the window and in a browser: passed or not, five results
// with what was needed, and one sentence on what to do differently. Words are English keys of the
// catalogue (formats/words/catalogue.h).
#pragma once

#include <string>
#include <vector>

#include "formats/scoring/session_score.h"

namespace sonocase {

inline constexpr std::size_t kMaxResults = 5;

struct ResultRow {
    std::string metric;  // of metric_table()
    const char* title = "";
    double value = 0;        // NaN: not defined for this attempt
    bool has_limit = false;  // false: no pass mark, shown without verdict
    bool at_least = false;   // the limit is a lower one
    double limit = 0;
    bool reached = true;
    // Places on a scale from 0 to 1 on which both value and limit lie.
    float value_at = 0, limit_at = 0;
};

struct AttemptResult {
    // false: the exercise has neither marks nor a procedure, and there is no verdict
    bool has_marks = false;
    bool passed = false;
    int marks = 0, marks_reached = 0;
    // All marks, missed ones before others, then other metrics up to kMaxResults rows.
    std::vector<ResultRow> rows;
    const char* advice = "";  // a sentence for the worst miss; empty: none
    // Of the first row, whose trend over attempts is worth a look; empty: there are no marks.
    std::string trend_metric;
    std::vector<double> trend;  // of that metric, oldest first, this attempt last; finite
};

// Without its trend, which whoever keeps attempts adds.
AttemptResult attempt_result(const SessionScore& score);

// "4.2 mm", "61 %", "1:47", "3"; a dash where it is not finite. Shares are shown in per cent.
std::string metric_words(const std::string& metric, double value);

}  // namespace sonocase
