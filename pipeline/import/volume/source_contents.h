// SPDX-License-Identifier: Apache-2.0

// What a path holds, as hospitals and segmenters hand it over: which part of it are the labels and
// which the scan.
#pragma once

#include <string>
#include <vector>

#include "formats/base/result.h"

namespace sonocase::pipeline::inline import_volume {

struct SourceContents {
    std::string labels;                 // for import_label_map; empty: there are none
    std::string scan;                   // for read_scan; empty: there is none
    std::string labels_kind;            // "DICOM segmentation", "folder of 104 masks", "label map"
    std::string scan_kind;              // "112 CT slices", "NIfTI, NRRD or MetaImage scan"
    std::vector<std::string> left_out;  // what else lies there, a phrase each
    double shear_deg = 0;  // of the slices of a tilted gantry, which need VolumeReading's
                           // resample_shear; 0: there are none
};

// Looks at headers, and at the values of volume files whose names are no structure's: labels are
// few whole numbers, none below 0. A folder may hold
//
//     a DICOM segmentation, or several that can be joined, beside its slices, at any depth, or
//     either alone
//     masks, one per structure, as TotalSegmentator writes them
//     a label map, a scan, or one of each
//     sub-folders that together hold no more than that, such as ct.nii.gz beside segmentations/, or
//     masks beside DICOM slices
//
// Errors, each with what is there and what to give instead: no such path; nothing that is known;
// several label maps, segmentations or scans; files of two patients (of two Patient IDs, in two
// frames of reference), which are named by their files and not by the patients.
// Cost: headers, and one read of each volume file that is looked at.
Result<SourceContents> contents_of(const std::string& path);

}  // namespace sonocase::pipeline::inline import_volume
