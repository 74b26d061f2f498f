// SPDX-License-Identifier: Apache-2.0

// Guards against files in metres, centimetres or micrometres: nothing else in a volume or a mesh
// tells its unit, and every later stage would run on plausible nonsense.
#pragma once

#include <optional>
#include <string>

#include "formats/base/geometry.h"
#include "formats/base/result.h"

namespace sonocase::pipeline {

// Bounds of the largest extent of a torso, of a part of one, or of a whole person, mm.
inline constexpr double kSmallestTorso_mm = 20;
inline constexpr double kLargestTorso_mm = 3000;

// An Error that names the factor to give if no torso has this extent. `what` is "body" or
// "surface", `option` where the factor goes: "--scale".
std::optional<Error> check_torso_extent(Vector3 extent_mm,
                                        const std::string& what,
                                        const std::string& where,
                                        const std::string& option);

// Likewise where two extents of one person differ as no two units of the same kind do; empty where
// they agree within a factor of six.
std::optional<Error> check_same_unit(Vector3 body_extent_mm,
                                     Vector3 surface_extent_mm,
                                     const std::string& where);

}  // namespace sonocase::pipeline
