// SPDX-License-Identifier: Apache-2.0

// Detects files in metres, centimetres or micrometres by the size of the body. Nothing else in a
// volume or a mesh shows its unit, and every later stage would accept the wrong one.
#pragma once

#include <optional>
#include <string>

#include "formats/base/geometry.h"
#include "formats/base/result.h"

namespace sonocase::pipeline {

// Bounds of the largest extent of a torso, a part of one, or a whole person, mm.
inline constexpr double kSmallestTorso_mm = 20;
inline constexpr double kLargestTorso_mm = 3000;

// An Error that suggests a scale factor if no torso has this extent. `what`: "body" or "surface";
// `option`: the option that takes the factor, such as "--scale".
std::optional<Error> check_torso_extent(Vector3 extent_mm,
                                        const std::string& what,
                                        const std::string& where,
                                        const std::string& option);

// Likewise if two extents of one person differ by more than a factor of six, as they do if their
// units differ.
std::optional<Error> check_same_unit(Vector3 body_extent_mm,
                                     Vector3 surface_extent_mm,
                                     const std::string& where);

}  // namespace sonocase::pipeline
