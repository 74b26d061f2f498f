// SPDX-License-Identifier: Apache-2.0

// How well a map fits the skin to the mannequin: exact distances from the readings to the triangles
// of the mapped skin, and the share of readings for which they exist.
#pragma once

#include <cstdint>
#include <vector>

#include "formats/base/result.h"
#include "formats/volume/surface.h"
#include "pipeline/registration/fit/target_surface.h"
#include "pipeline/registration/map/registration.h"
#include "pipeline/registration/skin/skin_surface.h"

namespace sonocase::pipeline::inline registration_fit {

// A reading farther from the skin than this is of something else: a hand, a table, a sensor that
// was laid down.
inline constexpr double kOffSkinMm = 25;

struct FitMeasure {
    double rms_mm = -1, median_mm = -1, p95_mm = -1, max_mm = -1;  // negative: no counterparts
    double mean_signed_mm = 0;  // > 0: the readings lie outside the skin
    double coverage = 0;        // readings with a counterpart over usable readings
    double skin_coverage = 0;   // skin points near a reading over all skin points
    // Depth of the skin that faces the table behind its plane, 95th percentile; 0 without a table.
    double behind_table_mm = 0;
    long readings = 0, counterparts = 0;
    // Near the skin, but farther than the others allow: lift-offs, folds of skin.
    long unexplained = 0;
    long off_skin = 0;  // farther than kOffSkinMm from the skin, which does not end there
};

// The mapped skin, mannequin frame relative to the target's origin.
Surface mapped_skin(const Surface& skin, const Registration& registration, Point3 target_origin);

FitMeasure measure_fit(const SkinSurfaceResult& skin,
                       const TargetSurface& target,
                       const Registration& registration);

// Distance from each mapped skin point to the mannequin's local plane, positive outside the
// mannequin; NaN without a counterpart.
std::vector<double> signed_gaps(const Surface& mapped, const TargetSurface& target);

// Which part of the skin was not fitted: no reading of the mannequin lies near.

inline constexpr double kNotFittedMm = 20;

// skin       ct mannequin  as digitised: readings or a mesh; readings of the table do not count
// Returns for each skin point 1 if its image lies farther than kNotFittedMm from all readings and
// triangles of the mannequin; empty if there is no such point. Errors: those of prepare_target.
// Cost: that of prepare_target, and 2 us per skin point.
Result<std::vector<std::uint8_t>> unfitted_skin(const Surface& skin,
                                                const Surface& mannequin,
                                                const Registration& registration);

}  // namespace sonocase::pipeline::inline registration_fit
