// SPDX-License-Identifier: Apache-2.0

// What this room reads of the text headers of NRRD and MetaImage itself: where the voxels lie in
// the patient, which files hold them, and whether all of them are there.
#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "formats/base/result.h"
#include "pipeline/import/volume/native_volume.h"

namespace sonocase::pipeline::inline import_volume {

// What a MetaImage header (.mha, .mhd) says about its voxels.
struct MetaHeader {
    std::string data_path;         // the header's own path if the voxels follow it; may be empty
    std::uint64_t voxels_at = 0;   // bytes to skip in that file
    bool voxels_from_end = false;  // they are the last bytes of that file
    bool is_binary = true;
    bool compressed = false;
    std::uint64_t compressed_bytes = 0;  // as stated; 0: up to the end of the file
    bool many_files = false;             // data_path is then empty
    std::string data_files;              // "LIST", or a numbered pattern
};
MetaHeader read_meta_header(const std::string& path);

// Done if every file that the header of a MetaImage or NRRD volume refers to is a regular file
// with content. For lists and numbered patterns all files in the header's folder are checked.
// `path` itself must have passed check_source_file. Any other format: Done.
Status check_data_files(const std::string& path);

// Where the text of an NRRD or MetaImage header places the voxels. Warnings: no orientation or no
// voxel size, and what is assumed; another unit than millimetres; two sizes that disagree. Errors,
// each naming the field: a number that is not finite or not there; a volume that is not of three
// dimensions.
Result<Placement> nrrd_placement(std::string_view header, const std::string& path);
Result<Placement> meta_placement(std::string_view header, const std::string& path);
// Of a file whose name ends in .nrrd, .nhdr, .mha or .mhd.
Result<Placement> placement_in_header(const std::string& path);

// An Error where the library below ITK would refuse an NRRD file without saying why.
Status check_nrrd_encoding(std::string_view header, const std::string& path);

// What an NRRD header says of its voxels besides their place, for encodings that the library below
// ITK was built without (bzip2).
struct NrrdVoxels {
    Component component = Component::u8;
    int layers = 1;
    bool planar = false;
    bool swapped = false;
    std::string data_path;                      // the header's own path if the voxels follow it
    std::uint64_t voxels_at = 0;                // in that file
    std::map<std::string, std::string> fields;  // keys of the writer's own
};
bool is_bzip2(std::string_view nrrd_header);
Result<NrrdVoxels> nrrd_voxels(std::string_view header, const std::string& path);
std::string header_text(const std::string& path);  // up to where the voxels begin

// Exactly `count` bytes that are packed with bzip2, one stream or several, from `at` to the end of
// the file. Room is made as they come. Errors: damaged or cut off; more than `count` bytes.
Result<std::vector<std::byte>> unpack_bzip2(std::span<const std::uint8_t> file,
                                            std::uint64_t at,
                                            std::uint64_t count,
                                            const std::string& path);

// An Error if the file, or all that it names together, hold fewer than `voxel_bytes` after the
// header, or damaged gzip; a warning where they hold more that are not packed; Done for files of
// another format. The library below ITK does not notice in a compressed NRRD file that
// the end of the stream is missing.
Status check_meta_length(const std::string& path,
                         std::uint64_t voxel_bytes,
                         std::vector<std::string>& warnings);
Status check_nrrd_length(const std::string& path,
                         std::uint64_t voxel_bytes,
                         std::vector<std::string>& warnings);

}  // namespace sonocase::pipeline::inline import_volume
