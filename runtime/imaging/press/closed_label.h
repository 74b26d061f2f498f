// SPDX-License-Identifier: Apache-2.0

// What a picture shows of a lumen whose walls touch.
#pragma once

#include <cstdint>
#include <vector>

#include "formats/bundle/case_bundle.h"

namespace sonocase::runtime::press {

// Per label: the label itself, or, of a draining lumen, the soft tissue that most often lies
// beside it (itself where there is none). Done when a scene is opened. Cost: 5 ms for a torso at
// 1 mm, nothing where no lumen drains.
std::vector<std::int32_t> closed_labels(const CaseBundle& bundle);

}  // namespace sonocase::runtime::press
