// SPDX-License-Identifier: Apache-2.0

// Where the voxels of a volume are that its header keeps in other files. Internal to import.
#pragma once

#include <cstdint>
#include <string>

#include "formats/base/result.h"

namespace sonocase::pipeline {

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

}  // namespace sonocase::pipeline
