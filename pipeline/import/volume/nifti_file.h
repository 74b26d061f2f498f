// SPDX-License-Identifier: Apache-2.0

// NIfTI-1 and NIfTI-2 in one file, plain or gzip whatever its name. Header and voxels are read here
// and by no library: those that read NIfTI replace numbers that are not finite, prefer the qform
// over the sform, and lose the placement of some axes. Internal to this room.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "formats/base/result.h"
#include "pipeline/anatomy/label_table.h"
#include "pipeline/import/volume/native_volume.h"

namespace sonocase::pipeline::inline import_volume {

struct NiftiHeader {
    std::int64_t bytes = 0;  // 348 or 540
    bool swapped = false;    // its bytes are in the other order than this machine's
    bool has_extensions = false;
    std::int64_t dim[8] = {0, 1, 1, 1, 1, 1, 1, 1};
    int datatype = 0;
    std::int64_t voxels_at = 0;
    double slope = 1, intercept = 0;  // value = slope * stored + intercept; 1 and 0 where not given
    Placement placement;

    Component component = Component::u8;
    std::int64_t channels() const { return dim[4] * dim[5] * dim[6] * dim[7]; }
    std::uint64_t voxel_bytes() const;  // of all channels
};

// From the first bytes of a file, 544 if it has as many. The sform places the voxels where its code
// is above 0, as for the programs that segment; else the qform; without both, the axes run to the
// left, to the front and to the head about the middle of the volume, as nibabel and FSL take them.
// Warnings: the two place a corner more than half a voxel apart; neither is there; sizes of pixdim
// and of the transform differ; another unit than millimetres.
// Errors: no NIfTI header of a single file; a size or type that no label map has; a number of the
// geometry that is not finite, named by its field.
Result<NiftiHeader> parse_nifti_header(std::span<const std::uint8_t> bytes,
                                       const std::string& path,
                                       Orientation orientation);

Result<NiftiHeader> read_nifti_header(const std::string& path, Orientation orientation);

// Errors besides those of the header: fewer voxels than the header promises; damaged compression;
// more than fit into memory.
Result<NativeVolume> read_nifti_volume(const std::string& path, const VolumeReading& reading);

// The label table in the extension of a NIfTI header (parse_label_xml); empty if the file has none.
// A damaged header is reported by the reader of the volume instead. Error: a damaged table.
Result<LabelTable> load_nifti_label_table(const std::string& path,
                                          Orientation orientation = Orientation::automatic);

}  // namespace sonocase::pipeline::inline import_volume
