// SPDX-License-Identifier: Apache-2.0

// A segmented CT as a label volume in the `ct` frame: the first stage of every case.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <string>
#include <vector>

#include "formats/base/result.h"
#include "formats/base/stage_report.h"
#include "formats/volume/label_volume.h"
#include "pipeline/base/progress.h"
#include "pipeline/import/volume/volume_file.h"

namespace sonocase::pipeline::inline import_volume {

// A colour that depends on the name alone, so that a structure keeps it from case to case.
inline std::array<std::uint8_t, 3> label_colour(const std::string& name) {
    std::uint32_t hash = 2166136261u;  // FNV-1a
    for (const char c : name) hash = (hash ^ static_cast<std::uint8_t>(c)) * 16777619u;
    const double hue = static_cast<double>(hash % 360u) / 60.0;  // sixths of the circle
    const double low = 90 + static_cast<double>((hash >> 10) % 60u);
    const double high = 200 + static_cast<double>((hash >> 20) % 50u);
    std::array<std::uint8_t, 3> rgb{};
    for (int c = 0; c < 3; ++c) {
        double away = std::abs(hue - 2.0 * c);  // from the hue of this channel
        away = std::min(away, 6.0 - away);
        const double share = away <= 1 ? 1 : away >= 2 ? 0 : 2 - away;
        rgb[c] = static_cast<std::uint8_t>(low + share * (high - low));
    }
    return rgb;
}

struct ImportOptions {
    std::string table;  // see label_table.h for its forms, and for what names values without it
    double scale = 1;   // mm per unit of the file, > 0
    VolumeReading reading;
    // Names of values that nothing names, one of names_options(). "auto": those of TotalSegmentator
    // v2 "total", with a warning unless sizes and places of the structures speak for them, and an
    // error where they speak against them, or for other names of three structures or more; never
    // where segments or other names show that the map is numbered otherwise. "none": label_1,
    // label_2, ... Else a numbering, which also comes before the names in the file.
    std::string names = "auto";
};

struct ImportedLabels {
    LabelVolume labels;  // `ct` frame, RAS+ mm; i nearest to right, j to front, k to head
    // Stage "import": labels, unnamed_labels, body_width_mm, body_volume_ml, ...
    StageReport report;
};

inline constexpr int kImportVersion = 2;
// Of how volumes are read: part of the key of cached labels.
inline constexpr int kVolumeReadingVersion = 4;

// path  NIfTI, NRRD, .seg.nrrd, MetaImage; a folder with one binary mask per structure (file name =
//       structure); a DICOM segmentation, or a folder with one (beside its CT, or alone) or with a
//       DICOM series whose pixels are label values; or a .labels file that import wrote, returned
//       unchanged.
// The palette holds the labels that occur, in order of value, after [0], the outside. Label::tissue
// comes from the table's tissue_class, else from the built-in tissue table by the name; a class
// that does not exist is an error. Where masks or segments overlap the smaller structure remains: a
// vessel stays in its liver.
//
// The report says what was assumed: names by number alone (assumed_names), the table that lay with
// the map (note "table"), and by a warning which
// of two transforms, which axes, which unit.
//
// Errors, each with what was found and what to do: no such file; a pipe or a device; unreadable or
// truncated; no body; two labels of one name; more than 254 labels; an extent that cannot be a
// torso in mm.
// Memory: the file's voxels in their own type plus two bytes per voxel.
Result<ImportedLabels> import_label_map(const std::string& path,
                                        const ImportOptions& options = {},
                                        const Progress& progress = {});

// "auto", "none", and the numberings that are known: "total", "total_v1", "amos", ...
std::vector<std::string> names_options();

// The table that lies with a label map: the CSV of its name beside it, else dataset.json, as
// nnU-Net and MONAI leave it, beside it or in the folder above. Empty: none.
std::string table_beside(const std::string& map);

// Bounding box of everything that is not outside, to the outer faces of the voxels, in the
// volume's frame.
Box3 body_box(const LabelVolume& labels);

}  // namespace sonocase::pipeline::inline import_volume
