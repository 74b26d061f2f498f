// SPDX-License-Identifier: Apache-2.0

// How well a map lays the skin on the mannequin: exact distances from readings to the mapped skin's
// triangles, and the share of readings that they were measured on.
#pragma once

#include <vector>

#include "formats/registration/registration.h"
#include "pipeline/registration/matching/target_surface.h"
#include "pipeline/registration/skin/skin_surface.h"

namespace sonocase::pipeline {

struct FitMeasure {
    double rms_mm = -1, median_mm = -1, p95_mm = -1,
           max_mm = -1;         // negative: no counterpart at all
    double mean_signed_mm = 0;  // > 0: readings lie outside the skin
    double coverage = 0;        // readings with a counterpart over usable readings
    double skin_coverage = 0;   // skin points that a reading lies near, over skin points
    long readings = 0, counterparts = 0;
    long unexplained = 0;  // over the skin, but too far off for the rest: lift-offs, clefts
};

// The skin through the map, mannequin frame less the target's origin.
Surface mapped_skin(const Surface& skin, const Registration& registration, Point3 target_origin);

FitMeasure measure_fit(const SkinSurfaceResult& skin,
                       const TargetSurface& target,
                       const Registration& registration);

// Distance from each mapped skin point to the mannequin's local plane, positive where the skin
// stands out of it; NaN where there is no counterpart.
std::vector<double> signed_gaps(const Surface& mapped, const TargetSurface& target);

}  // namespace sonocase::pipeline
