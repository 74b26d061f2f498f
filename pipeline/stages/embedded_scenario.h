// SPDX-License-Identifier: Apache-2.0

// scenarios/demo-torso, compiled in by CMake.
#pragma once

#include <string_view>
#include <vector>

#include "formats/bundle/case_bundle.h"

namespace sonocase::pipeline::inline stages {

std::string_view embedded_case_toml();
std::vector<EmbeddedExercise> embedded_exercises();

}  // namespace sonocase::pipeline::inline stages
