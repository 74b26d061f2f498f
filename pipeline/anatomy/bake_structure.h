// SPDX-License-Identifier: Apache-2.0

// Structure inside organs that no label volume has, without which every organ would be plain noise.
//
// The result is one echo offset per voxel, in quarters of a dB, which the image model "physical"
// adds to the echogenicity of the voxel's tissue. Offsets within a label are whole dB apart: the
// steps are invisible under speckle, and keep the bundle small. Kinds, each with a switch:
//
//   parenchyma     smooth noise of Tissue::structure_db, grain 3 to 5 mm, in every soft tissue
//   liver_vessels  portal and hepatic venous trees grown from the labelled roots, with dark lumen
//                  and bright portal walls (liver_vessels.h)
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
#include "pipeline/anatomy/liver_vessels.h"
#include "pipeline/anatomy/muscle_fibres.h"
#include "pipeline/base/progress.h"

namespace sonocase::pipeline::inline anatomy {

struct BakeStructureOptions {
    std::uint64_t seed = 1;
    bool parenchyma = true;
    bool liver_vessels = true;
    bool kidney = true;
    bool muscle_fibres = true;
    bool fat_septa = true;
    bool bowel_wall = true;
    bool fascia = true;
};

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

// Volumes finer than the structure itself have one echo offset per cell of 2 or 4 voxels per edge.
//
// bake_structure draws no detail below a millimetre that would remain visible under speckle, and
// smaller voxels can therefore share a value: with an eighth of the values, in an eighth of the
// time. A cell takes the label at its centre; at a surface, the offset of one side may extend half
// a cell into the other.

inline constexpr double kStructureCellMm = 1;

// Voxels per edge of a cell: 1, 2 or 4, the largest that is within kStructureCellMm.
int structure_cell(double voxel_mm);

// Bytes for a cooked voxel of the depths below the skin and through fat, which are held while
// structure is baked: samples every 2 and every 3 mm, in whole cells.
double structure_depth_bytes(double voxel_mm);

// Like bake_structure; echo_offset is on the grid of `cooked`.
Result<BakeStructureResult> bake_structure_in_cells(const LabelVolume& cooked,
                                                    std::span<const Tissue> tissues,
                                                    const BakeStructureOptions& options = {},
                                                    const Progress& progress = {});

}  // namespace sonocase::pipeline::inline anatomy
