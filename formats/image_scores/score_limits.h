// SPDX-License-Identifier: Apache-2.0

// The limits of realism: what scores of living tissue lie in. docs/realism.md says where each comes
// from: blocks of six frames of a tracked sweep of one volunteer's liver (CC BY 4.0, ImFusion GmbH,
// public-ultrasound-demos), widened by about a tenth for other machines.
#pragma once

#include <optional>
#include <span>
#include <string_view>

#include "formats/image_scores/patch_scores.h"
#include "formats/image_scores/structure_scores.h"

namespace sonocase {

struct ScoreLimits {
    std::string_view name;   // "liver_mean": also in JSON
    std::string_view title;  // "liver mean grey"
    std::string_view unit;   // "mm"; empty: a ratio
    double low = 0, high = 0;
    bool holds(double value) const { return value >= low && value <= high; }
};

// In the order of docs/realism.md.
std::span<const ScoreLimits> score_limits();
// The limits of that name, which must exist.
const ScoreLimits& limits_of(std::string_view name);

}  // namespace sonocase
