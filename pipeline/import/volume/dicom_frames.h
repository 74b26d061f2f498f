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
inline constexpr DicomTag kTagSyntax = 0x00020010, kTagCharacterSet = 0x00080005,
                          kTagImageType = 0x00080008, kTagSopClass = 0x00080016,
                          kTagInstance = 0x00080018, kTagModality = 0x00080060,
                          kTagCode = 0x00080100, kTagScheme = 0x00080102, kTagMeaning = 0x00080104,
                          kTagDescription = 0x0008103e, kTagReferencedSeries = 0x00081115,
                          kTagReferencedImages = 0x0008114a, kTagReferencedInstance = 0x00081155,
                          kTagRegion = 0x00082218, kTagRegionModifier = 0x00082220,
                          kTagPatient = 0x00100020, kTagThickness = 0x00180050,
                          kTagBetween = 0x00180088, kTagSeries = 0x0020000e,
                          kTagAcquisition = 0x00200012, kTagNumber = 0x00200013,
                          kTagPosition = 0x00200032, kTagOrientation = 0x00200037,
                          kTagFrameOfReference = 0x00200052, kTagMoment = 0x00200100,
                          kTagInAcquisition = 0x00201002, kTagInSeries = 0x00201209,
                          kTagPlanePosition = 0x00209113, kTagPlaneOrientation = 0x00209116,
                          kTagFrameContent = 0x00209111, kTagFrameMoment = 0x00209128,
                          kTagFrameAcquisition = 0x00209156, kTagOrganization = 0x00209311,
                          kTagSamples = 0x00280002, kTagFrames = 0x00280008, kTagRows = 0x00280010,
                          kTagColumns = 0x00280011, kTagPixelSpacing = 0x00280030,
                          kTagBits = 0x00280100, kTagStored = 0x00280101, kTagHighBit = 0x00280102,
                          kTagSigned = 0x00280103, kTagPadding = 0x00280120,
                          kTagPaddingLimit = 0x00280121, kTagIntercept = 0x00281052,
                          kTagSlope = 0x00281053, kTagLossy = 0x00282110,
                          kTagPixelMeasures = 0x00289110, kTagTransformation = 0x00289145,
                          kTagSlices = 0x00540081, kTagType = 0x00620001, kTagSegments = 0x00620002,
                          kTagCategory = 0x00620003, kTagSegmentNumber = 0x00620004,
                          kTagLabel = 0x00620005, kTagSegmentIdentification = 0x0062000a,
                          kTagReferencedSegment = 0x0062000b, kTagColour = 0x0062000d,
                          kTagMaximum = 0x0062000e, kTagPropertyType = 0x0062000f,
                          kTagFractionalType = 0x00620010, kTagTypeModifier = 0x00620011,
                          kTagShared = 0x52009229, kTagPerFrame = 0x52009230,
                          kTagPixels = 0x7fe00010, kTagItem = 0xfffee000, kTagItemEnd = 0xfffee00d,
                          kTagSequenceEnd = 0xfffee0dd;

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
// One frame of run lengths (PackBits) of 8 bits, or of several bytes, each as a plane, the upper
// one first. False where it is damaged.
bool unpack_dicom_runs(std::string_view from, std::size_t pixels, std::size_t bytes, char* to);
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
