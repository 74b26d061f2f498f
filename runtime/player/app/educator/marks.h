// SPDX-License-Identifier: Apache-2.0

// Pass marks that an educator changes in the window. The exercise with its new marks is a TOML file
// in the folder BUNDLE.exercises beside the case, in the place of the one that the case brings.
#pragma once

#include <string>
#include <vector>

#include "runtime/player/app/states.h"

namespace sonocase::runtime {

void begin_marks(App& app);
// Moves a limit by one step of its unit: 5 % for shares, 10 s for times, 1 for everything else.
void step_mark(Exercise::PassMark& mark, int steps);
// Saves and opens it. Not while an attempt runs; a file that cannot be written becomes a notice.
void save_marks(App& app);

// The text of an exercise with other marks: everything else stays as it is written.
std::string toml_with_marks(const std::string& toml, const std::vector<Exercise::PassMark>& marks);

}  // namespace sonocase::runtime
