// SPDX-License-Identifier: Apache-2.0

// The palette and the solids of the analytic torso.
#pragma once

#include <vector>

#include "formats/volume/label_volume.h"
#include "pipeline/anatomy/torso/solids.h"

namespace sonocase::pipeline {

struct TorsoAnatomy {
    std::vector<Label> labels;  // outside first
    std::vector<Solid> solids;  // where solids overlap, the last one counts
};

// The same object at every call. Thread-safe.
const TorsoAnatomy& torso_anatomy();
const TorsoAnatomy& tube_phantom();

}  // namespace sonocase::pipeline
