// SPDX-License-Identifier: Apache-2.0

// The plots of a review as inline SVG: one time axis, one lane per subject.
#pragma once

#include <string>

#include "pipeline/review/review_input.h"

namespace sonocase::pipeline {

// Bars for probe on skin, needle in tissue and contact with spared structures; marks for events;
// below, inserted length, tip to target, tip to plane and the part of the needle in the beam.
std::string timeline_svg(const ReviewInput& input);

// A score over this trainee's sessions of the exercise, ending with this one; empty without earlier
// ones.
std::string progress_svg(const ReviewInput& input, const std::string& metric);

}  // namespace sonocase::pipeline
