// SPDX-License-Identifier: Apache-2.0

// Calibrations as other programs keep them: PLUS's CoordinateDefinitions (XML), ITK's transform
// files (.tfm) as 3D Slicer writes them, and 4 x 4 matrices as plain text, row by row.
//
// All hold sensor_from_tool, mm. A .tfm holds its inverse in LPS+, because ITK's transforms
// resample: they map the fixed image's points, the tool's parent here, to the moving one's. Read
// and written so that 3D Slicer shows the same "transform to parent" as ours.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "formats/base/result.h"
#include "formats/calibration/calibration.h"

namespace sonocase {

// True for the three forms, by what a file holds, and for binary files, such as transforms in HDF5,
// which are then refused with the cure. A matrix may have semicolons between cells and decimal
// commas.
bool looks_like_foreign_calibration(std::string_view text);

// Of XML every tool whose transform it has, outside comments: NeedleTip to anything is the needle,
// or StylusTip where there is none, and what is not taken is a warning of the calibration;
// Mannequin to anything the mannequin, ProbeFace to Probe the probe's face (x along it, z into the
// body); TransducerOrigin to Probe as well (PLUS: x along the face, y into the body), composed
// where the file has its parts. Of the others one, whose kind the file's name says: needle, stylus,
// probe, mannequin. They say neither errors nor dates. Errors: no such transform; a scale or
// mirror; a name that says no kind; a transform of another type than affine.
Result<std::vector<Calibration>> parse_foreign_calibrations(std::string_view text,
                                                            const std::string& where);

// In the form of the path's ending: .xml, .tfm, .txt; "" for others. The scale of a mannequin and
// the errors are lost (XML keeps the rms).
std::string format_foreign_calibration(const Calibration& calibration, const std::string& path);

}  // namespace sonocase
