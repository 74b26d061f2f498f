// SPDX-License-Identifier: Apache-2.0

// What the page shows about a case and its exercises, as JSON text.
#pragma once

#include <string>
#include <string_view>

#include "formats/exercise/course.h"
#include "runtime/tracking/guided_start.h"
#include "runtime/web/page_player.h"

namespace sonocase::runtime::inline web {

// {"case_name", "title", "complications": {name: title}, "presets": [{"name", "tip", "depth_mm",
// "focus_mm"}], "exercises": [{"name", "title", "description", "texts": {"de": {title, description,
// hints, steps, items}}, "mastery", "mark_mm": half_face_mm(), "kind", "difficulty", "mode":
// "practice" or "exam", "hints": [texts], "drawn", "targets": [names], "pass_marks": [{"metric",
// "at_most", "at_least"}]}], "labels": [{"name", "english", and label_parts(): "words", "side",
// "number"}], "warnings": [texts]}; a limit that does not exist is null.
std::string case_json(const PagePlayer& player);

// {"fit": "none", "fits", "differs" or "unreadable", "name", "fingerprint"}.
std::string signature_json(const CaseSignature& signature);

// [{"name", "title", "unit"}] of every score, in the order of metric_table().
std::string metric_words_json();

// The page after an attempt (attempt_result.h): {"has_marks", "passed", "marks", "marks_reached",
// "advice", "trend": null or {"metric", "title", "limit"} of the first row, "rows": [{"title",
// "value", "measured", "has_limit", "at_least", "none", "limit", "reached"}], "measures":
// [{"title", "value", "evidence"}] of all that were measured}. Values and limits of rows are words;
// "none": the limit is an upper one of 0.
std::string result_json(const SessionScore& score);

// {"step", "steps", "title", "words"}; step is kGuideSteps when all are done.
std::string guide_json(const GuidedStart& guide);

// The last events of an attempt, oldest first, as a page translates them: [format, argument, ...],
// each argument a list of the same form. "[]" without an attempt.
std::string events_json(const PagePlayer& player);

// Where the procedure of an attempt stands: {"steps": [{title, instruction, state}], "present": n,
// "question": {item, words, options} or null, "tray": [{kind, index, amount, words}],
// "complications": [words], and what the hands have done}. "{}" without a procedure.
std::string procedure_json(const PagePlayer& player);

// {"name", "title", "text", "modules": [{"name", "title", "text", "case", "exercise", "expert",
// "question", "options", "answer", "because", "measure", "at_most", "at_least", "gate":
// {"passes_in_a_row", "steady", "exam"}, "retention_days"}]}.
std::string course_json(const Course& course);

// How a trainee stands in a course, by what a browser or a learning platform has kept: {"today",
// "attempts": [{"case", "exercise", "started", "passed", "exam", "seed", "values": {measure:
// number}}] oldest first, "answers": [{"module", "option"}]}. Returns {"passed", "due", "next",
// "modules": [{"option", "open", "passed", "due", "passed_on", "due_on", "kept_on", "attempts",
// "in_a_row", "cusum", "cusum_needed", "measured", "in_limits", "part"}]}; part: how much of the
// gate has been reached, 1 once it is passed. Error: what was kept is damaged.
Result<std::string> course_standing_json(const Course& course, std::string_view kept);

// How a trainee stands with exercises, for the cards of the cases (course_standing.h): {"attempts":
// as above, "asked": [{"case", "exercise", "mastery"}]}. Returns for each that is asked
// {"attempts", "passes", "mastered", "best_mm"}; null: no attempt has that measure.
Result<std::string> standings_json(std::string_view kept);

}  // namespace sonocase::runtime::inline web
