// SPDX-License-Identifier: Apache-2.0

// What this room reads of a volume's header itself: where the voxels are that the header keeps in
// other files, whether all of them are there, its orientation and its table of labels.
#pragma once

#include <cstdint>
#include <string>

#include "formats/base/result.h"
#include "pipeline/anatomy/label_table.h"

namespace sonocase::pipeline::inline import_volume {

// What a MetaImage header (.mha, .mhd) says about its voxels.
struct MetaHeader {
    std::string data_path;        // the header's own path if the voxels follow it; may be empty
    std::uint64_t voxels_at = 0;  // bytes to skip in that file
    bool compressed = false;
    bool many_files = false;  // a list or a numbered pattern; data_path is then empty
};
MetaHeader read_meta_header(const std::string& path);

// Done if every file that the header of a MetaImage or NRRD volume refers to is a regular file
// with content. For lists and numbered patterns all files in the header's folder are checked.
// `path` itself must have passed check_source_file. Any other format: Done.
Status check_data_files(const std::string& path);

// An Error if the file holds fewer than `voxel_bytes` after its header, or is damaged gzip; Done
// for files of another format. The library below ITK fills what is missing in a NIfTI file with
// zeros, and its NRRD reader does not notice that the end of a compressed stream is missing.
Status check_nifti_length(const std::string& path, std::uint64_t voxel_bytes);
Status check_meta_length(const std::string& path, std::uint64_t voxel_bytes);
Status check_nrrd_length(const std::string& path, std::uint64_t voxel_bytes);  // if compressed

// A warning where a NIfTI file says nothing about its orientation (qform_code and sform_code are
// 0), so that right and left are a guess; empty for any other file.
std::string nifti_orientation_warning(const std::string& path);

// The label table in the extension of a NIfTI header (parse_label_xml); empty if the file has none.
// A damaged header is reported by the reader of the volume instead. Error: a damaged table.
Result<LabelTable> load_nifti_label_table(const std::string& path);

}  // namespace sonocase::pipeline::inline import_volume
