// SPDX-License-Identifier: Apache-2.0

// Structure for volumes finer than structure is: an echo offset a cell of 2 or 4 voxels an edge.
//
// bake_structure.h draws nothing finer than a millimetre that speckle would leave to be seen, so
// that voxels below that share a value: an eighth of the memory's information, of the bundle and of
// the time. A cell takes the label in its middle; on a surface the offset of one side may reach
// half a cell into the other.
#pragma once

#include "pipeline/anatomy/bake_structure.h"

namespace sonocase::pipeline {

inline constexpr double kStructureCellMm = 1;

// Voxels an edge of a cell: 1, 2 or 4, the most that stay within kStructureCellMm.
int structure_cell(double voxel_mm);

// As bake_structure, echo_offset on the grid of `cooked`.
Result<BakeStructureResult> bake_structure_in_cells(const LabelVolume& cooked,
                                                    std::span<const Tissue> tissues,
                                                    const BakeStructureOptions& options = {},
                                                    const Progress& progress = {});

}  // namespace sonocase::pipeline
