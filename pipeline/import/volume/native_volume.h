// SPDX-License-Identifier: Apache-2.0

// A volume as its file holds it, before its values are interpreted as labels. Internal to import.
#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "formats/base/result.h"
#include "formats/volume/grid.h"
#include "pipeline/import/volume/volume_file.h"

namespace sonocase::pipeline {

enum class Component { u8, i8, u16, i16, u32, i32, u64, i64, f32, f64 };

struct NativeVolume {
    Grid grid;  // RAS+ mm; orthonormal axes in any order and of any handedness
    Component component = Component::u8;
    int layers = 1;                // values per voxel, stored side by side
    std::vector<std::byte> bytes;  // # voxels * layers * size of component
    std::map<std::string, std::string> fields;
    std::vector<std::string> warnings;
};

VolumeSize size_in_file_header(const std::string& path);            // one file
Result<NativeVolume> read_itk_volume(const std::string& path);      // one file
Result<NativeVolume> read_dicom_series(const std::string& folder);  // the folder's largest series

// An Error if a NIfTI file holds fewer than `voxel_bytes` after its header, or is damaged gzip: the
// library below ITK silently fills with zeros what is missing. Done for any other file.
Status check_nifti_length(const std::string& path, std::uint64_t voxel_bytes);
// A warning where a NIfTI file says nothing about its orientation (qform_code and sform_code are
// 0), so that right and left are a guess; empty for any other file.
std::string nifti_orientation_warning(const std::string& path);
// The same as check_nifti_length for MetaImage.
Status check_meta_length(const std::string& path, std::uint64_t voxel_bytes);
// The same for compressed NRRD, whose reader does not notice that the end of the stream is missing.
Status check_nrrd_length(const std::string& path, std::uint64_t voxel_bytes);

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

}  // namespace sonocase::pipeline
