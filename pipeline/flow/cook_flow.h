// SPDX-License-Identifier: Apache-2.0

// Cooks the flow field of a case: courses of the labelled vessels, and the blood that runs through
// them; writes it as a table and as pictures.
//
// Sources, the table of normal flow, accuracy and limits: docs/flow.md. Cost at 1 mm: 1 to 3 s for
// the vessels of a torso; the field takes 20 to 60 kB in a bundle.
#pragma once

#include <string>

#include "formats/base/result.h"
#include "formats/base/stage_report.h"
#include "formats/flow/flow_field.h"
#include "formats/volume/label_volume.h"
#include "pipeline/base/progress.h"

namespace sonocase::pipeline::inline flow {

inline constexpr int kFlowVersion = 3;

struct FlowOptions {
    bool on = true;
    double rate_per_min = 70;   // at which peak velocities are fitted to normal ones
    double scale = 1;           // of every flow
    double node_mm = 3;         // between sections
    double shortest_mm = 25;    // vessels shorter than this are left out
    double unknown_ml_min = 0;  // through vessels whose names say nothing; 0: by their size
    std::string unknown_wave = "artery";  // "steady", "artery", "vein"
};

struct FlowResult {
    FlowField field;  // rounded as a bundle keeps it
    // vessels, nodes, bytes, worst_balance; flow, diameter and PSV of each vessel
    StageReport report;
};

// labels  in the frame `mannequin`, with the tissues of the case
// A case without vessels has an empty field and a warning. Diameters that no such vessel has are
// warnings. Gives the same bytes on every machine with any number of threads (one is used).
Result<FlowResult> cook_flow(const LabelVolume& labels,
                             const FlowOptions& options = {},
                             const Progress& progress = {});

// The table's columns: name, kind, length_mm, diameter_mm, flow_ml_min, mean_cm_s, peak_cm_s,
// end_cm_s, resistive_index; outlets without a course have no lengths and velocities.
std::string flow_table_csv(const FlowField& field, double rate_per_min);

// Writes flow.png: courses from the front and from the side, waveforms of flow, and profiles at the
// systolic peak. Makes the folder. Error: it cannot be written. Cost: 0.3 s.
Status draw_flow(const FlowField& field, double rate_per_min, const std::string& folder);

}  // namespace sonocase::pipeline::inline flow
