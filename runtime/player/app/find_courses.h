// SPDX-License-Identifier: Apache-2.0

// Where the player finds its courses (formats/exercise/course.h).
#pragma once

#include <string>
#include <vector>

#include "formats/exercise/course.h"
#include "runtime/player/app/notices.h"

namespace sonocase::runtime::inline player_app {

// The courses in the folders in which cases are looked for: files that are called course.toml, or
// end in .course.toml; `given`, if any, comes first. One that cannot be read is left out, with a
// notice of its file and line; of two of the same name the first counts.
std::vector<Course> find_courses(const std::string& given, Notices& notices);

}  // namespace sonocase::runtime::inline player_app
