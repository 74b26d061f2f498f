// SPDX-License-Identifier: Apache-2.0

// Landmarks as a CSV: rows name,ct_x,ct_y,ct_z,x,y,z in mm, the last three on the mannequin's
// surface; or as two lists of marks (CSV of name,x,y,z, or markups of 3D Slicer), one on either
// body.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "formats/base/result.h"
#include "pipeline/registration/register_surfaces.h"

namespace sonocase::pipeline::inline registration {

// A header row names the columns, in any order: ct_x (or patient_, scan_, image_) on the patient, x
// or mannequin_x (surface_, phantom_) on the mannequin; l, p, s and r, a, s are axes too, and a
// unit may stand behind ("ct_x_cm"). Errors name file and line: a header that does not name each of
// the seven once; rows that hold no six numbers.
Result<std::vector<Landmark>> parse_landmarks(std::string_view csv, const std::string& where);
// surface_path: the marks on the surface where `path` holds those of the patient alone; marks are
// paired by name, and those that one file lacks are an error. Empty: `path` holds pairs.
Result<std::vector<Landmark>> load_landmarks(const std::string& path,
                                             const std::string& surface_path = "");

}  // namespace sonocase::pipeline::inline registration
