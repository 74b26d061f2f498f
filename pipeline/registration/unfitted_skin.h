// SPDX-License-Identifier: Apache-2.0

// Which part of the skin was not fitted: no reading of the mannequin lies near.
#pragma once

#include <cstdint>
#include <vector>

#include "formats/base/result.h"
#include "formats/registration/registration.h"
#include "formats/volume/surface.h"

namespace sonocase::pipeline {

inline constexpr double kNotFitted_mm = 20;

// skin       ct
// mannequin  as digitised: readings or a mesh; readings of the table do not count
// Of each skin point 1 if its image lies farther than kNotFitted_mm from the mannequin, be that a
// reading or a point of a triangle. Empty if there is no such point. Errors: those of
// prepare_target. Cost: that of prepare_target, and 2 us per skin point.
Result<std::vector<std::uint8_t>> unfitted_skin(const Surface& skin,
                                                const Surface& mannequin,
                                                const Registration& registration);

}  // namespace sonocase::pipeline
