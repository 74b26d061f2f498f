// SPDX-License-Identifier: Apache-2.0

// A volume as its file holds it, before its values are interpreted as labels. Internal to this
// room.
#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "formats/base/result.h"
#include "formats/base/stage_report.h"
#include "formats/volume/label_volume.h"
#include "pipeline/import/volume/volume_file.h"

namespace sonocase::pipeline::inline import_volume {

enum class Component { u8, i8, u16, i16, u32, i32, u64, i64, f32, f64 };

struct NativeVolume {
    Grid grid;  // RAS+ mm; orthonormal axes in any order and of any handedness
    Component component = Component::u8;
    int layers = 1;                // values per voxel, stored side by side
    std::vector<std::byte> bytes;  // # voxels * layers * size of component
    std::map<std::string, std::string> fields;
    std::vector<Note> notes;  // what was found and assumed, for the report
    std::vector<std::string> warnings;
};

VolumeSize size_in_file_header(const std::string& path);        // one file
Result<NativeVolume> read_itk_volume(const std::string& path);  // one file
// A DICOM segmentation or an object of several frames; a folder with one segmentation, beside the
// scan that it was drawn on or alone; or a folder's largest series. resample_shear: slices of a
// tilted gantry are moved by whole pixels; else they are an error.
Result<NativeVolume> read_dicom(const std::string& path, bool resample_shear = false);
VolumeSize size_in_dicom(const std::string& path);  // by headers alone

// How to permute and flip the axes of a grid so that they lie nearest to those of its frame.
struct AxisOrder {
    int source[3] = {0, 1, 2};                // axis i of the result is this axis of the source
    bool flipped[3] = {false, false, false};  // and runs against it
};
AxisOrder canonical_axes(const Matrix3& direction);
Grid reoriented(const Grid& grid, const AxisOrder& order);
// Voxel (i, j, k) of the result is voxel number start + i * step[0] + j * step[1] + k * step[2] of
// the source.
struct AxisWalk {
    std::ptrdiff_t start = 0;
    std::ptrdiff_t step[3] = {0, 0, 0};
};
AxisWalk axis_walk(const Grid& source, const AxisOrder& order);

}  // namespace sonocase::pipeline::inline import_volume
