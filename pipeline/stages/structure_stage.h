// SPDX-License-Identifier: Apache-2.0

// The result of the stage "structure".
#pragma once

#include <cstdint>
#include <vector>

#include "formats/base/stage_report.h"
#include "formats/volume/brick_volume.h"

namespace sonocase::pipeline::inline stages {

// Echo offsets alone, without the labels that they belong to.
struct EchoOffsets {
    BrickVolume<std::int8_t> offset;  // quarter dB, on the grid of the cooked labels
    std::vector<StageReport> reports;
};

}  // namespace sonocase::pipeline::inline stages
