// Which settings for a wanted accuracy, or for the time there is?
//
// The table of measured settings (measured_front.inc, written by scripts/accuracy from a sweep of
// the whole case on the demo torso) gives the error; seconds follow a model fitted to the same
// sweep,
//     seconds = speed * (a + b * volume / voxel^3)
// with `speed` from a probe of about a second on this machine.
#pragma once

#include <string>
#include <vector>

#include "formats/result.h"
#include "pipeline/cook/stage_options.h"
#include "pipeline/tradeoff/trial.h"

namespace sonocase::pipeline {

struct FrontRow {
    Settings settings;
    double error_mm = 0;  // mean displacement of surfaces, demo torso
    double seconds = 0;   // on the machine of the sweep
};

struct FrontTable {
    std::vector<FrontRow> rows;
    double volume_mm3 = 0;     // of the demo torso's cooked grid
    double probe_seconds = 1;  // of the probe on the machine of the sweep
};
const FrontTable& measured_front();

// a and b of the model above by least squares over the rows; both >= 0.
struct CostModel {
    double fixed_s = 0;
    double per_voxel_s = 0;
};
CostModel fit_cost_model(const FrontTable& table);

// measured_front.inc from a sweep of the suite "case" on the demo torso.
std::string format_front(const std::vector<Trial>& trials, double volume_mm3, double probe_seconds);

// Seconds of a fixed piece of the pipeline's own work on this machine, with the threads now
// allowed.
double probe_seconds();

struct Wish {
    double tolerance_mm = 0;   // > 0: the cheapest settings whose error is within
    double time_budget_s = 0;  // > 0: the best settings whose time is within; both: tolerance first
};

struct Choice {
    Settings settings;
    double predicted_error_mm = 0;
    double predicted_seconds = 0;
    std::string warning;  // what of the wish cannot be had; empty: all of it
};

// volume_mm3: of the case's cooked grid, about the mannequin's bounding box; speed: probe_seconds()
// over the table's. The table has at least one row.
Choice choose_settings(const FrontTable& table, const Wish& wish, double volume_mm3, double speed);

}  // namespace sonocase::pipeline
