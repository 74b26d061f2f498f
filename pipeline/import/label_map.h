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
    // Stage "import": labels, unnamed_labels, body_width_mm, body_volume_ml, ...
    StageReport report;
};

inline constexpr int kImportVersion = 2;

// path  NIfTI, NRRD, .seg.nrrd, MetaImage; a folder with one binary mask per structure (file name =
//       structure); a folder with a DICOM series whose pixels are label values; or a .labels file
//       that import wrote, returned unchanged.
// The palette holds the labels that occur, in order of value, after [0], the outside. Label::tissue
// comes from the table's tissue_class, else from the built-in tissue table by the name; a class
// that does not exist is an error. Where masks or segments overlap the smaller structure remains: a
// vessel stays in its liver.
//
// Errors, each with what was found and what to do: no such file; a pipe or a device; unreadable or
// truncated; no body; two labels of one name; more than 254 labels; an extent that cannot be a
// torso in mm.
// Memory: the file's voxels in their own type plus two bytes per voxel.
Result<ImportedLabels> import_label_map(const std::string& path,
                                        const ImportOptions& options = {},
                                        const Progress& progress = {});

// Bounding box of everything that is not outside, to the outer faces of the voxels, in the
// volume's frame.
Box3 body_box(const LabelVolume& labels);

}  // namespace sonocase::pipeline
