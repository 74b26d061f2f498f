// SPDX-License-Identifier: Apache-2.0

// What `inspect` and the reports say about a flow field.
#pragma once

#include <string>
#include <vector>

#include "formats/flow/flow_field.h"

namespace sonocase {

struct VesselSummary {
    std::string name;
    FlowKind kind = FlowKind::artery;
    bool course = false;  // false: an outlet that the labels lack; no lengths, no velocities
    double length_mm = 0;
    double diameter_mm = 0;  // of a circle of the median section
    double mean_ml_min = 0;
    double mean_cm_s = 0;        // over section and beat
    double peak_cm_s = 0;        // PSV: fastest blood of the beat, at the median section
    double end_cm_s = 0;         // EDV: at the end of diastole
    double resistive_index = 0;  // (PSV - EDV) / PSV
};
// One per vessel; the round ones (grown trees) share one entry per kind.
std::vector<VesselSummary> vessel_summaries(const FlowField& field, double beat_s);

// The greatest difference between the flows into and out of a junction at any phase, relative to
// the greatest flow through it.
double worst_balance(const FlowField& field);

const char* name_of(FlowKind kind);  // "artery"

}  // namespace sonocase
