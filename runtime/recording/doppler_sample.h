// SPDX-License-Identifier: Apache-2.0

// What a recording keeps of a frame in a Doppler mode: the report with its labels by name.
#pragma once

#include <vector>

#include "formats/recording/session.h"
#include "formats/volume/label_volume.h"
#include "runtime/imaging/frame/doppler_report.h"

namespace sonocase::runtime {

// labels: of the bundle; indices outside of it name nothing.
DopplerSample doppler_sample(const DopplerReport& report, const std::vector<Label>& labels);

}  // namespace sonocase::runtime
