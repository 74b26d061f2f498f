// SPDX-License-Identifier: Apache-2.0

// Small label maps written byte by byte in every format that import reads, so that the reader is
// tested against the formats' own definitions and not against the library that it uses.
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "formats/volume/label_volume.h"

namespace sonocase::testing {

// A voxel array of 8 bits, x fastest, with the RAS+ position of voxel (i, j, k):
// origin + columns * (i, j, k).
struct TinyVolume {
    Int3 size{0, 0, 0};
    Matrix3 columns;  // voxel steps in RAS+, mm
    Point3 origin;    // RAS+, mm
    std::vector<std::uint8_t> voxels;
    int layers = 1;  // fastest

    Point3 position(int i, int j, int k) const {
        return origin + columns * Vector3{double(i), double(j), double(k)};
    }
};

// Labels as a function of the RAS+ position, sampled.
TinyVolume sample(Int3 size,
                  const Matrix3& columns,
                  Point3 origin,
                  const std::function<int(Point3)>& label);

// Columns with axes permuted and flipped: axis a of the volume runs along world axis order[a],
// against it where flip[a]; origin such that the volume covers the same box [0, extent].
TinyVolume sample_in_order(const int (&order)[3],
                           const bool (&flip)[3],
                           Vector3 extent_mm,
                           Vector3 spacing_mm,
                           Point3 corner,
                           const std::function<int(Point3)>& label);

std::string nifti_bytes(const TinyVolume& volume, const std::string& extension_xml = "");
std::string nrrd_bytes(const TinyVolume& volume,
                       const std::string& fields = "",
                       bool lps = true,
                       bool gzip = false);
std::string mha_bytes(const TinyVolume& volume, bool compressed = false);
std::string gzip_bytes(const std::string& bytes);
// What a slice's header says besides its position.
struct DicomCounts {
    int in_acquisition = 0, in_series = 0;  // number of slices; 0: not given
    double round_to_mm = 0;                 // rounding of the position; 0: none
    std::string position, thickness;        // texts instead of the true ones
    int stored_bits = 16;                   // the upper bits of each pixel are set if fewer
    bool is_signed = false;
    std::vector<std::int16_t> values = {};  // of all voxels, instead of the volume's own
    std::string person;  // in every element that names or describes the patient; empty: none
    std::string frame_of_reference;
    std::string instance, acquisition, moment, description;  // empty: its own, none, ...
    bool lossy = false;
    std::vector<int> padding = {};  // value, and limit where there are two
};
// One slice of an uncompressed DICOM series of unsigned 16-bit values, explicit little-endian.
std::string dicom_slice(const TinyVolume& volume,
                        int k,
                        const std::string& series,
                        const DicomCounts& counts = {});

// A multi-frame DICOM object of the volume, explicit little-endian.
struct TinySegment {
    int number = 1;
    std::string label;
    std::vector<int> values;                   // of the volume that are inside
    std::string meaning;                       // of its type's code; empty: none
    std::string code = "10200004", side = {};  // SNOMED CT: of the type, and of its modifier
};
struct TinyObject {
    std::string kind = "BINARY";  // FRACTIONAL, LABELMAP, or CT: its pixels are the values
    std::vector<TinySegment> segments;
    int bits = 8;                                  // of LABELMAP
    int inside = 255, outside = 0, maximum = 255;  // of FRACTIONAL
    bool reversed = false;                         // the frames run from the last to the first
    bool all_frames = false;                       // also those without a voxel inside
    std::vector<int> without;                      // slices that have no frame
    double between_mm = 0, thickness_mm = 0;       // 0: none
    std::string first_position;                    // instead of the first frame's own
    bool placed_by_header = false;                 // CT: by the elements of a single slice
    std::string modality;                          // empty: by the kind
    std::string packing;                           // "run lengths", "deflate"; empty: none
    std::string frame_of_reference = "1.2.3.7";
    std::string patient;
};
std::string dicom_object(const TinyVolume& volume, const TinyObject& object);

}  // namespace sonocase::testing
