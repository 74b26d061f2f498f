// SPDX-License-Identifier: Apache-2.0

// The result of `sonocase look` for people (a self-contained page) and for programs (JSON).
#pragma once

#include <string>

#include "pipeline/look/look.h"

namespace sonocase::pipeline::inline look {

std::string look_page(const LookResult& result);
// {"machine", "scan": {...}, "frames": {...}, "looks": [...], "scores": [...], "kept": [...],
// "warnings": [...]}; what was not measured is null.
std::string look_json(const LookResult& result);

}  // namespace sonocase::pipeline::inline look
