// SPDX-License-Identifier: Apache-2.0

// Landmarks as a CSV: rows name,ct_x,ct_y,ct_z,x,y,z in mm, the last three on the mannequin's
// surface.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "formats/base/result.h"
#include "pipeline/registration/register_surfaces.h"

namespace sonocase::pipeline::inline registration {

// A header row is allowed. Errors name file and line.
Result<std::vector<Landmark>> parse_landmarks(std::string_view csv, const std::string& where);
Result<std::vector<Landmark>> load_landmarks(const std::string& path);

}  // namespace sonocase::pipeline::inline registration
