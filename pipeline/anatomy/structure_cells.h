// SPDX-License-Identifier: Apache-2.0

// Structure for volumes finer than the structure itself: one echo offset per cell of 2 or 4 voxels
// per edge.
//
// bake_structure.h draws no detail below a millimetre that would remain visible under speckle, and
// smaller voxels can therefore share a value: with an eighth of the values, in an eighth of the
// time. A cell takes the label at its centre; at a surface, the offset of one side may extend half a
// cell into the other.
#pragma once

#include "pipeline/anatomy/bake_structure.h"

namespace sonocase::pipeline {

inline constexpr double kStructureCellMm = 1;

// Voxels per edge of a cell: 1, 2 or 4, the largest that is within kStructureCellMm.
int structure_cell(double voxel_mm);

// Like bake_structure; echo_offset is on the grid of `cooked`.
Result<BakeStructureResult> bake_structure_in_cells(const LabelVolume& cooked,
                                                    std::span<const Tissue> tissues,
                                                    const BakeStructureOptions& options = {},
                                                    const Progress& progress = {});

}  // namespace sonocase::pipeline
