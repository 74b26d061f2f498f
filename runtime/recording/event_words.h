// SPDX-License-Identifier: Apache-2.0

// Events of an attempt in words for the trainee.
#pragma once

#include <string>
#include <vector>

#include "formats/exercise/exercise.h"
#include "formats/scoring/session_monitor.h"
#include "formats/volume/label_volume.h"

namespace sonocase::runtime {

// "Reached: lesion"; empty for events that are not shown.
std::string event_words(const LiveEvent& event,
                        const Exercise& exercise,
                        const std::vector<Label>& labels);

}  // namespace sonocase::runtime
