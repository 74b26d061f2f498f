// SPDX-License-Identifier: Apache-2.0

// What the page shows about a case and its exercises, as JSON text.
#pragma once

#include <string>

#include "runtime/web/page_player.h"

namespace sonocase::runtime::inline web {

// {"case_name", "exercises": [{"name", "title", "description", "kind", "difficulty", "mode":
// "practice" or "exam", "hints": [texts], "targets":
// [names], "pass_marks": [{"metric", "at_most", "at_least"}]}], "labels": [names], "warnings":
// [texts]}; a limit that does not exist is null.
std::string case_json(const PagePlayer& player);

// [{"name", "group", "title", "unit"}] of every score, in the order of metric_table().
std::string metric_words_json();

// Where the procedure of an attempt stands: {"steps": [{title, instruction, state}], "present": n,
// "question": {item, words, options} or null, "tray": [{kind, index, amount, words}],
// "complications": [words], and what the hands have done}. "{}" without a procedure.
std::string procedure_json(const PagePlayer& player);

}  // namespace sonocase::runtime::inline web
