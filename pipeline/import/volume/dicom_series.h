// SPDX-License-Identifier: Apache-2.0

// What a folder of DICOM files holds, which of them make up one stack of slices, and in what order;
// faults of the stack are found in the headers, before any pixel is read. Internal to this room.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "formats/base/geometry.h"
#include "formats/base/result.h"
#include "formats/volume/label_volume.h"

namespace sonocase::pipeline::inline import_volume {

// Where a header puts one frame. Positions and directions are those of DICOM: to the left, to the
// back, to the head.
struct DicomFrame {
    bool has_position = false, has_orientation = false;
    Point3 position;                                      // centre of the first pixel
    Vector3 along_rows{1, 0, 0}, along_columns{0, 1, 0};  // unit vectors at right angles
    double row_spacing_mm = 0, column_spacing_mm = 0;  // from row to row, column to column; 0: none
    double thickness_mm = 0, between_mm = 0;  // SliceThickness, SpacingBetweenSlices; 0: none
    int segment = 0;                          // Referenced Segment Number; 0: none
    std::string phase;  // Frame Acquisition Number, Temporal Position Index; empty: none
    std::string fault;  // an element that holds no finite numbers; else empty

    bool placed() const { return has_position && has_orientation; }
    Vector3 normal() const { return cross(along_rows, along_columns); }
};

// How the pixels of a file are stored.
struct DicomPixels {
    bool sound = false;        // one whole number each, by the header
    bool plain = false;        // whole little-endian numbers of 8 or 16 bits from `at` on,
    bool run_lengths = false;  // or run lengths of them
    std::uint64_t at = 0;
    int bits = 0, stored = 0;
    bool is_signed = false;
    bool lossy = false;               // packed in a way that changes values
    double slope = 1, intercept = 0;  // value = slope * stored + intercept
    bool padded = false;              // stored numbers from low to high were never measured
    int low = 0, high = 0;

    bool is_like(const DicomPixels& other) const {
        return plain && other.plain && run_lengths == other.run_lengths && bits == other.bits &&
               stored == other.stored && is_signed == other.is_signed && slope == other.slope &&
               intercept == other.intercept;
    }
};

// What the header of one file with pixels says.
struct DicomSlice {
    std::string path;
    std::string instance;     // SOP Instance UID
    std::string series;       // Series Instance UID
    std::string acquisition;  // Acquisition Number
    std::string moment;       // Temporal Position Identifier
    std::string modality, description, frame_of_reference;
    std::string patient;  // Patient ID
    int rows = 0, columns = 0;
    std::vector<DicomFrame> frames;  // one, of an object of several frames all
    int of_frame = 0;      // a frame of an object of several, from 1; 0: the only one of its file
    int file_frames = 1;   // of its file
    bool between = false;  // is in no file: the mean of its neighbours
    bool cut_off = false;  // the file ends before its pixels do
    DicomPixels pixels;
    int number = 0;                         // Instance Number; 0: none
    int declared = 0;                       // number of slices that the header declares; 0: none
    bool declared_for_acquisition = false;  // that number counts one acquisition, not the series

    const DicomFrame& place() const { return frames.front(); }
};

// A DICOM object that is no slice.
struct DicomObject {
    std::string path;
    std::string modality = {};             // "SEG", "RTSTRUCT", "SR", ...
    std::string frame_of_reference = {};   // Frame of Reference UID
    std::string series = {};               // Series Instance UID of the images that it refers to
    bool cut_off = false;                  // a segmentation that ends before its pixels do
    std::string patient = {};              // Patient ID
    std::vector<std::string> images = {};  // SOP Instance UIDs of the images that it refers to
    Box3 box = {};                         // of a segmentation's frames, in DICOM's axes
    Vector3 normal = {};                   // of them; 0: not known
};

struct DicomFolder {
    std::vector<DicomSlice> slices;           // CT, MR and others that may hold labels
    std::vector<DicomSlice> other_slices;     // of series that no segmentation here was drawn on,
                                              // where the one that it was drawn on lies here too
    std::vector<DicomObject> segmentations;   // of any kind
    std::vector<DicomObject> structure_sets;  // RTSTRUCT
    std::vector<DicomObject> others;          // reports, doses, localizers, ...
    std::vector<std::string> damaged;         // DICOM files whose header cannot be read
};

// Every DICOM object in the folder and its sub-folders, in the order of their names; or in the
// file. Other files are skipped.
DicomFolder read_dicom_headers(const std::string& path);

std::vector<std::string> paths_of(const std::vector<DicomObject>& objects);

// "2 SR (a.dcm, ...), 1 PR (b.dcm)"; empty for none. named: with file names, which no report gets,
// as they may name the patient.
std::string objects_text(const std::vector<DicomObject>& objects, bool named = true);

// A phrase for each series: "70 x CT from IM1, 'Follow-up'".
std::vector<std::string> series_texts(std::vector<DicomSlice> slices);

struct DicomStack {
    std::vector<DicomSlice> slices;  // ascending along the stack
    std::vector<DicomSlice> others;  // of the other series
    std::vector<std::string> warnings;
};

// What a stack is for.
struct StackUse {
    bool scan = false;  // else labels
    // Labels that lie in it or refer to it, for the choice among several.
    std::vector<DicomObject> labels = {};
};

// The series in which the labels lie, among several or without labels that with the most slices, in
// order; those of one object of several frames as one slice each. Slices may lie off even spacing
// by a twentieth of it, as rounding of positions leaves them. A copy of a file counts once.
//
// Of a scan, with a warning each: of several phases in one place (by Acquisition Number, Temporal
// Position, or the order of their numbers) that which the labels refer to or lie in, else the
// first; slices that are turned against most of the others, or lie nowhere, are set aside; a slice
// that alone is missing between two others becomes their mean, in up to a tenth of the stack.
//
// Errors, each naming a file, and the series where there are several: a slice that is cut off, does
// not say where it lies or how large its pixels are, is turned against the others, is there twice,
// is missing between two others, or is missing at an end by the number that a header declares;
// numbers that are not finite; spacing that is uneven in another way. Cost: n log n.
Result<DicomStack> dicom_stack(std::vector<DicomSlice> slices,
                               const std::string& folder,
                               const StackUse& use = {});

// By how many degrees the slices slide over one another (a tilted gantry) where that is too much to
// be squared; else 0.
double shear_deg(const DicomStack& stack);

// Whether the slices are labels: few whole numbers, none below 0. Errors: such slices are not
// sound as labels, or the slices cannot be read as a scan either. Cost: that of reading them.
Result<bool> slices_hold_labels(const DicomFolder& folder, const std::string& path);

}  // namespace sonocase::pipeline::inline import_volume
