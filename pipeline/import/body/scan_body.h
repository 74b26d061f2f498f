// SPDX-License-Identifier: Apache-2.0

// What a map of organs lacks to be a body, from the CT that it was drawn on.
//
// The body is what is denser than air: an opening in the slice plane takes off table, sheets and
// wires, the largest part that is left is the body, its edge is given back and its holes are filled
// slice by slice. What of it the map leaves without a label becomes, by the median of 3 x 3 x 3
// voxels in Hounsfield units (thresholds as usual for CT, assumed):
//
//     gas_in_body below -300, also within stomach, duodenum, bowel and colon
//     other_fat   from -300 to below -30
//     other_muscle from -30 to 200: muscle, bowel wall, discs, vessels too small to be labelled
//     other_bone  above 200
//     skin        the outermost 2 mm towards air, one voxel at least, of the last three
//
// A label of the whole body ("body", "body_trunc", "External", a skin that is no thin layer) counts
// as no label: what lies within is what the scan is for.
//
// The faces of the grid are no skin: there the field of view cuts the body.
#pragma once

#include <string>

#include "formats/base/result.h"
#include "pipeline/import/volume/label_map.h"
#include "pipeline/import/volume/volume_file.h"

namespace sonocase::pipeline::inline import_body {

inline constexpr int kScanBodyVersion = 2;

// Completes the labels in place. A map that has a label in 95 % of the body is left as it is, with
// a warning, and so is a word said of labels of the whole body. The report gets the measures
// scan_body_ml and scan_filled_ml, scan_fat_in_organs and scan_bone_hu where enough of these is
// labelled, and the note "scan". The scan's grid may be another than that of the labels: the
// nearest voxel counts. A warning where organs have the density of fat or air in more than 12 % of
// their voxels. Errors: a scan that does not cover the labels, is in no Hounsfield units, shows no
// body where the labels are, or shows neither organs nor bone there. Cost: 0.1 us per voxel of the
// label map and 0.3 us per voxel filled in. Memory: four bytes per voxel of the label map.
Status fill_from_scan(const ScanVolume& scan, const std::string& where, ImportedLabels& imported);

}  // namespace sonocase::pipeline::inline import_body
