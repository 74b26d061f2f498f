// SPDX-License-Identifier: Apache-2.0

// Which files of a folder make up one stack of DICOM slices, and in what order; faults of the stack
// are found in the headers, before any pixel is read. Internal to this room.
#pragma once

#include <string>
#include <vector>

#include "formats/base/geometry.h"
#include "formats/base/result.h"

namespace sonocase::pipeline::inline import_volume {

// What the header of one file says. Positions and directions are those of DICOM: to the left, to
// the back, to the head.
struct DicomSlice {
    std::string path;
    std::string series;       // Series Instance UID
    std::string acquisition;  // Acquisition Number
    std::string thickness;    // Slice Thickness
    int rows = 0, columns = 0, frames = 1;
    bool cut_off = false;                   // the file ends before its pixels do
    int number = 0;                         // Instance Number; 0: none
    int declared = 0;                       // number of slices that the header declares; 0: none
    bool declared_for_acquisition = false;  // that number counts one acquisition, not the series
    bool placed = false;                    // position and orientation are there
    Point3 position;
    Vector3 along_rows{1, 0, 0}, along_columns{0, 1, 0};
};

// The slices of every DICOM image in the folder, in the order of their names. Other files are
// skipped, folders are not looked into.
std::vector<DicomSlice> read_dicom_headers(const std::string& folder);

struct DicomStack {
    std::vector<DicomSlice> slices;  // ascending along the stack
    std::vector<std::string> warnings;
};

// The series with the most slices, in order. Slices may lie off even spacing by a twentieth of it,
// as rounding of positions leaves them. Errors, each naming a file: a slice that is cut off, does
// not say where it lies, is turned against the others, is there twice, is missing between two
// others, or is missing at an end by the number that a header declares; spacing that is uneven in
// another way. Cost: n log n.
Result<DicomStack> dicom_stack(std::vector<DicomSlice> slices, const std::string& folder);

}  // namespace sonocase::pipeline::inline import_volume
