// SPDX-License-Identifier: Apache-2.0

// A flow field as a table and as pictures.
#pragma once

#include <string>

#include "formats/base/result.h"
#include "formats/flow/flow_field.h"

namespace sonocase::pipeline {

// name, kind, length_mm, diameter_mm, flow_ml_min, mean_cm_s, peak_cm_s, end_cm_s, resistive_index;
// outlets without a course have no lengths and velocities.
std::string flow_table_csv(const FlowField& field, double rate_per_min);

// flow.png: courses from the front and from the side, waveforms of flow, and profiles at the
// systolic peak. Makes the folder. Error: it cannot be written. Cost: 0.3 s.
Status draw_flow(const FlowField& field, double rate_per_min, const std::string& folder);

}  // namespace sonocase::pipeline
