// SPDX-License-Identifier: Apache-2.0

// The elements of a DICOM file, and where its frames lie: by the functional groups of a multi-frame
// object, by its own elements where it has none. Internal to this room.
//
// Headers are read here and not by GDCM, which ends the program at some damaged files and makes up
// what is missing. No pixel is read.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "pipeline/import/volume/dicom_series.h"

namespace sonocase::pipeline::inline import_volume {

// Group and element number: 0x00280010 is Rows.
using DicomTag = std::uint32_t;

// Elements one after another, as they lie in a file.
struct DicomSet {
    std::string_view bytes;
    bool has_kinds = true;  // each names its value representation
    bool big_endian = false;
};

// The header of a file, whose elements have all been found to lie within one another and the file.
struct DicomHeader {
    DicomHeader() = default;
    DicomHeader(DicomHeader&&) = default;
    DicomHeader& operator=(DicomHeader&&) = default;

    std::vector<char> bytes;  // of the file's beginning, or of all of it, inflated
    std::string transfer_syntax;
    DicomSet set;  // the elements before the pixels; a view of `bytes`
    bool inflated = false;
    bool has_pixels = false;
    bool packed = false;           // the pixels are compressed
    std::uint64_t pixels_at = 0;   // in the file, or in `bytes` if inflated
    std::uint64_t pixels_end = 0;  // as the header says; beyond the file: it is cut off
    std::uint64_t size = 0;        // of the file, or of `bytes` if inflated

    bool cut_off(std::uint64_t pixel_bytes) const {
        return pixels_end > size || (!packed && pixels_at + pixel_bytes > size);
    }
};
bool is_dicom_file(const std::string& path);  // by its first bytes
// Empty for a file of another kind and for one whose header is damaged or cut off.
std::optional<DicomHeader> read_dicom_header(const std::string& path);

// The fragments of pixels that are packed.
std::vector<std::string> read_dicom_fragments(const std::string& path, const DicomHeader& header);
// What was deflated, without the padding behind it; empty where it is damaged.
std::vector<char> inflate_dicom(std::string_view bytes);

// Elements that are missing or damaged give an empty text, 0 or no items.
std::string text_of(const DicomSet& set, DicomTag tag);  // without padding
std::vector<std::uint16_t> shorts_of(const DicomSet& set, DicomTag tag);
int short_of(const DicomSet& set, DicomTag tag);  // the first of 16 bits
int whole_of(const DicomSet& set, DicomTag tag);  // text of 1 .. 1e6; else 0
std::vector<DicomSet> items_of(const DicomSet& set, DicomTag tag);

// The place of each of the object's frames. One whose numbers are damaged or not finite says which
// in `fault`.
std::vector<DicomFrame> frames_of(const DicomSet& set, int frames);

// The lattice of slices like `frame`, whose first pixel lies at `first` in DICOM's axes, in RAS+.
Grid ras_grid(Point3 first, const DicomFrame& frame, double step_mm, Int3 size);

}  // namespace sonocase::pipeline::inline import_volume
