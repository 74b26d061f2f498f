// SPDX-License-Identifier: Apache-2.0

// Medical volumes as files: NIfTI, NRRD (also .seg.nrrd), MetaImage, or a folder with a DICOM
// series.
//
// Placement is converted at this border: whatever the file's axis order and world convention, the
// grid that comes out is RAS+ millimetres with its axes turned and flipped so that i points nearest
// to right, j to front and k to head. Oblique scans keep the rest of their tilt in grid.direction.
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "formats/base/result.h"
#include "formats/volume/label_volume.h"

namespace sonocase::pipeline {

// A volume of few distinct whole numbers, in one or more layers (a .seg.nrrd may have several).
struct LabelLayers {
    Grid grid;
    std::vector<std::int32_t> values;  // ascending, distinct, over all layers; # <= 256
    std::vector<std::vector<std::uint8_t>> layers;  // # layers x # voxels, index into values
    std::map<std::string, std::string> fields;      // NRRD key-value pairs
    std::vector<std::string> warnings;
};

// Fails on values that are no whole numbers and on more than 256 distinct ones (a CT, most likely).
// Cost: one pass; memory: the file's voxels in its own type and one byte each.
Result<LabelLayers> read_label_layers(const std::string& path);

// A CT in Hounsfield units, rounded and held to 16 bits.
struct ScalarVolume {
    Grid grid;
    std::vector<std::int16_t> voxels;
    std::vector<std::string> warnings;
};

Result<ScalarVolume> read_scalar_volume(const std::string& path);

// Bytes of voxels that a file's header speaks of, nothing else being read; 0 where it cannot be
// told.
std::uint64_t voxel_bytes_in_header(const std::string& path);

// True for names that read_label_layers takes as a single file.
bool is_volume_file_name(const std::string& path);
// File name without folder and without its volume ending: "a/liver.nii.gz" -> "liver".
std::string volume_stem(const std::string& path);

}  // namespace sonocase::pipeline
