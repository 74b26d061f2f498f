// SPDX-License-Identifier: Apache-2.0

// A segmented CT as a label volume in the `ct` frame: the first stage of every case.
#pragma once

#include <string>
#include <vector>

#include "formats/base/result.h"
#include "formats/base/stage_report.h"
#include "formats/volume/label_volume.h"
#include "pipeline/base/progress.h"

namespace sonocase::pipeline {

struct ImportOptions {
    std::string table;  // CSV of value,name[,tissue_class]; empty: see label_table.h for the order
    double scale = 1;   // mm per unit of the file, > 0
};

struct ImportedLabels {
    LabelVolume labels;  // `ct` frame, RAS+ mm; i nearest to right, j to front, k to head
    StageReport
        report;  // stage "import": labels, unnamed_labels, body_width_mm, body_volume_ml, ...
};

inline constexpr int kImportVersion = 2;

// path  NIfTI, NRRD, .seg.nrrd, MetaImage; a folder of one binary mask a structure (file name =
//       structure); a folder with a DICOM series whose pixels are label values; or a .labels that
//       import wrote, taken as it stands.
// The palette holds the labels that occur, by rising value after [0], the outside. Label::tissue is
// what the built-in tissue table says of the name, or of the table's tissue_class where the name is
// not known. Where masks or segments overlap the smaller structure wins: a vessel stays in its
// liver.
//
// Errors, each with what was found and what to do: no such file; unreadable or truncated; no body;
// two labels of one name; more than 254 labels; an extent that cannot be a torso in mm.
// Cost: the file's voxels in their own type plus two bytes a voxel.
Result<ImportedLabels> import_label_map(const std::string& path,
                                        const ImportOptions& options = {},
                                        const Progress& progress = {});

// Box of everything that is not outside, edge to edge of the voxels, in the volume's frame.
Box3 body_box(const LabelVolume& labels);

}  // namespace sonocase::pipeline
