// SPDX-License-Identifier: Apache-2.0

// Medical volumes as files: NIfTI, NRRD (also .seg.nrrd), MetaImage, a DICOM segmentation, or a
// folder with one or with a DICOM series.
//
// Placement is converted here: whatever the file's axis order and world convention, the returned
// grid is in RAS+ millimetres, its axes permuted and flipped so that i points most nearly to the
// patient's right, j to the front and k to the head. Oblique scans keep their remaining tilt in
// grid.direction.
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "formats/base/result.h"
#include "formats/base/stage_report.h"
#include "formats/volume/label_volume.h"

namespace sonocase::pipeline::inline import_volume {

// Which of the two transforms of a NIfTI header places its voxels. automatic: the sform where its
// code is above 0, with a warning where the two disagree.
enum class Orientation { automatic, sform, qform };

struct VolumeReading {
    Orientation orientation = Orientation::automatic;
    bool resample_shear = false;  // slanted axes: nearest voxels of a grid with right angles
};

// A volume of few distinct whole numbers in one or more layers (a .seg.nrrd may have several).
struct LabelLayers {
    Grid grid;
    std::vector<std::int32_t> values;  // ascending, distinct, over all layers; # <= 256
    std::vector<std::vector<std::uint8_t>> layers;  // # layers x # voxels, index into values
    std::map<std::string, std::string> fields;      // NRRD key-value pairs
    std::vector<Note> notes;                        // what was found and assumed, for the report
    std::vector<std::string> warnings;
};

// Every number of the geometry is read from the header itself and is finite (nifti_file.h,
// volume_header.h). Values that a scale factor of the header leaves near whole numbers are rounded.
//
// Errors: not a readable volume; a pipe or a device; values that are not whole numbers; more than
// 256 distinct ones (most likely a CT). Cost: one pass; memory: the file's voxels in its own type
// and one byte each.
Result<LabelLayers> read_label_layers(const std::string& path, const VolumeReading& reading = {});

// A scan: values in Hounsfield units where it is a CT, rounded to whole numbers of 16 bits.
struct ScanVolume {
    Grid grid;
    std::vector<std::int16_t> values;
    std::vector<std::string> warnings;
};

// Reads a NIfTI, NRRD or MetaImage file, or the largest series of a DICOM folder, whatever
// segmentation lies beside it. Errors: as those of read_label_layers; several values per voxel.
// Memory: the file's voxels in its own type and two bytes each.
Result<ScanVolume> read_scan(const std::string& path, const VolumeReading& reading = {});

// Whether the voxels are labels, as read_label_layers takes them, and not those of a scan: few
// whole numbers of which none is below 0. Errors: it cannot be read. Cost: that of reading it.
Result<bool> holds_labels(const std::string& path, const VolumeReading& reading = {});

// The number of voxels of a file or of a folder with a DICOM series, and the bytes that they take
// in their own type. Only headers are read. For a folder of masks, those of one mask. 0: they
// cannot be read.
struct VolumeSize {
    std::uint64_t voxels = 0, bytes = 0;
    Vector3 spacing_mm{0, 0, 0};  // along the file's axes; 0: not known
};
VolumeSize size_in_headers(const std::string& path);

// True for names that read_label_layers takes as a single file.
bool is_volume_file_name(const std::string& path);
// File name without folder and without its volume ending: "a/liver.nii.gz" -> "liver".
std::string volume_stem(const std::string& path);

}  // namespace sonocase::pipeline::inline import_volume
