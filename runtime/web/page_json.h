// SPDX-License-Identifier: Apache-2.0

// What the page shows about a case and its exercises, as JSON text.
#pragma once

#include <string>

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

// The page after an attempt (attempt_result.h): {"has_marks", "passed", "marks", "marks_reached",
// "advice", "rows": [{"title", "value", "measured", "has_limit", "at_least", "none", "limit",
// "reached"}], "measures": [{"title", "value", "evidence"}] of all that were measured}. Values and
// limits are words; "none": the limit is an upper one of 0.
std::string result_json(const SessionScore& score);

// {"step", "steps", "title", "words"}; step is kGuideSteps when all are done.
std::string guide_json(const GuidedStart& guide);

// Where the procedure of an attempt stands: {"steps": [{title, instruction, state}], "present": n,
// "question": {item, words, options} or null, "tray": [{kind, index, amount, words}],
// "complications": [words], and what the hands have done}. "{}" without a procedure.
std::string procedure_json(const PagePlayer& player);

}  // namespace sonocase::runtime::inline web
