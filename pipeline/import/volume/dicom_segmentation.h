// SPDX-License-Identifier: Apache-2.0

// DICOM segmentation objects: BINARY, FRACTIONAL and LABELMAP. Internal to this room.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "formats/base/result.h"
#include "pipeline/import/volume/dicom_series.h"
#include "pipeline/import/volume/native_volume.h"

namespace sonocase::pipeline::inline import_volume {

// One layer whose values are segment numbers; the segments' names stand in `fields` as a .seg.nrrd
// has them, what was found and assumed in `notes`.
//
// Frames lie where their positions say, on a lattice whose step is SpacingBetweenSlices, or that of
// the scan (`scan_step_mm`, 0: not known), or the least distance of two frames; places without a
// frame are outside. Where segments overlap the smaller one remains, of two of one size the later
// one. Of a FRACTIONAL object a voxel is inside from half of MaximumFractionalValue on. A name is
// the Segment Label; where that names nothing that is known here, the structure that the type's
// SNOMED CT code means ("named_by_code" in the notes), or the type's meaning where the label says
// nothing or another segment has it.
//
// Errors: damaged or cut off; compressed in a way that is not known; frames that belong to no
// segment, do not say where they lie, are turned against one another, or lie on no even lattice.
// resample_shear: frames that lie beside the lattice go to its nearest pixels.
// Memory: the file, and one or two bytes per voxel.
Result<NativeVolume> read_dicom_segmentation(const std::string& path,
                                             double scan_step_mm,
                                             bool resample_shear);

// Several as one, the smaller segment over the larger; numbered anew, from 1. Errors: as those of
// grid_of_segmentations, and of each.
Result<NativeVolume> read_dicom_segmentations(const std::vector<std::string>& paths,
                                              double scan_step_mm,
                                              bool resample_shear);

// What holds several segmentations, by their headers. Errors: they are of several frames of
// reference or lattices, or have a name in common.
Result<Grid> grid_of_segmentations(const std::vector<std::string>& paths,
                                   double scan_step_mm,
                                   bool resample_shear);

VolumeSize size_in_segmentations(const std::vector<std::string>& paths);

// The compressed pixels of a file, of 8 or 16 bits, by GDCM; false where it cannot read them.
bool unpack_dicom_pixels(
    const std::string& path, int columns, int rows, int frames, int bits, char* to);

// Which slice of an even stack each frame is.
struct FrameLattice {
    double step_mm = 0;
    int slices = 0;
    std::vector<int> slice;  // # frames
    std::vector<std::string> warnings;
};
// `places`: of each frame along the normal, mm, not empty. See read_dicom_segmentation for the
// step.
Result<FrameLattice> lattice_of(const std::vector<double>& places,
                                const DicomFrame& frame,
                                double scan_step_mm,
                                const std::string& path);

// Calls run(first, count) for each run of ones among `count` bits, which begin at bit `first` of
// the bytes; bit 0 is the lowest of byte 0. The runs count from `first`.
template <class Run>
void for_bit_runs(const std::uint8_t* bytes, std::size_t first, std::size_t count, Run run) {
    std::size_t n = 0, start = 0;
    bool inside = false;
    while (n < count) {
        const std::size_t at = first + n;
        const std::uint8_t byte = bytes[at / 8];
        // A whole byte that changes nothing.
        if (at % 8 == 0 && n + 8 <= count && byte == (inside ? 0xff : 0)) {
            n += 8;
            continue;
        }
        const bool one = (byte >> (at % 8)) & 1;
        if (one && !inside) start = n;
        if (!one && inside) run(start, n - start);
        inside = one;
        ++n;
    }
    if (inside) run(start, count - start);
}

}  // namespace sonocase::pipeline::inline import_volume
