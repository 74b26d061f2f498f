// SPDX-License-Identifier: Apache-2.0

// Structure inside organs that no label volume has, without which every organ would be plain noise.
//
// The result is one echo offset per voxel, in quarters of a dB, which the image model "physical"
// adds to the echogenicity of the voxel's tissue. Offsets within a label are whole dB apart: the
// steps are invisible under speckle, and keep the bundle small. Kinds, each with a switch:
//
//   parenchyma     smooth noise of Tissue::structure_db, grain 3 to 5 mm, in every soft tissue
//   liver_vessels  portal and hepatic venous trees grown from the labelled roots, with dark lumen
//                  and bright portal walls (structure/vessel_tree.h)
//   kidney         cortex, pyramids and the sinus fat between them
//   muscle_fibres  fascicles along the axis of a long muscle, or around the body in sheets;
//                  2 voxels and at least 1.6 mm thick, 8 mm long (full widths)
//   fat_septa      sheets parallel to the skin in subcutaneous fat
//   bowel_wall     bright, dark, bright, dark layers from outside in, then mixed contents
//   fascia         a bright layer, 0.5 to 1.5 mm thick, between muscle and fat
//
// Nothing is added that the label volume already has (liver vessel labels, a renal sinus label).
// The mean offset of each label is 0 dB, which preserves the meaning of the tissue table. Fluid,
// gas, bone and the outside have none.
//
// Sources: the figures of docs/textures.md, measured on real images; radii after Murray (1926): the
// cubes of the radii of the branches add up to that of the trunk.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "formats/base/result.h"
#include "formats/base/stage_report.h"
#include "formats/volume/brick_volume.h"
#include "formats/volume/label_volume.h"
#include "formats/volume/tissue.h"
#include "pipeline/anatomy/structure/muscle_directions.h"
#include "pipeline/anatomy/structure/structure_options.h"
#include "pipeline/anatomy/structure/vessel_tree.h"
#include "pipeline/base/progress.h"

namespace sonocase::pipeline {

struct BakeStructureResult {
    BrickVolume<std::int8_t> echo_offset;  // quarter dB, size of the grid
    std::vector<VesselTree> trees;         // frame of the grid, mm
    std::vector<FibreField> fibres;        // one per muscle label
    StageReport report;                    // stage "structure"
};

// cooked: cubic voxels. tissues: contains every Label::tissue by name.
// Error: a label whose tissue is not in the table, or voxels that are not cubes.
// Same bytes for any number of threads. Cost: 40 M voxels of 1 mm in less than 5 s on two cores.
Result<BakeStructureResult> bake_structure(const LabelVolume& cooked,
                                           std::span<const Tissue> tissues,
                                           const BakeStructureOptions& options = {},
                                           const Progress& progress = {});

}  // namespace sonocase::pipeline
