// SPDX-License-Identifier: Apache-2.0

// Volumes as NRRD, which 3D Slicer and many other tools read.
#pragma once

#include <cstdint>
#include <map>
#include <span>
#include <string>
#include <vector>

#include "formats/volume/grid.h"

namespace sonocase::pipeline {

// NRRD, gzip-compressed, in the space right-anterior-superior (the axes of `mannequin`, for
// which NRRD has no name; Slicer shows it upright). type: "uchar", "signed char" or "unsigned int".
struct NrrdVolume {
    Grid grid;
    std::string type;
    std::span<const std::uint8_t> bytes;        // voxels, x fastest, little-endian
    std::map<std::string, std::string> fields;  // key:=value
};
std::vector<std::uint8_t> nrrd_file(const NrrdVolume& volume);

}  // namespace sonocase::pipeline
