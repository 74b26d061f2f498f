// SPDX-License-Identifier: Apache-2.0

// The chunks `vox.*` of docs/format.md, part 2: labels and boundary records. For the .cpp files of
// formats/ only.
#pragma once

#include "formats/bundle/codec/chunk_file.h"
#include "formats/bundle/codec/packed_blocks.h"
#include "formats/bundle/codec/packed_volumes.h"
#include "formats/volume/surface_patch.h"

namespace sonocase::detail {

// Takes the patches from boundary.patches where there are any, and fits the others. reach_steps:
// the largest distance of a record, in 1/48 voxel.
void add_surfaces(ChunkWriter& writer,
                  const BlockGrid& grid,
                  const BrickVolume<std::uint8_t>& labels,
                  const BoundaryBricks& boundary,
                  int reach_steps,
                  JobRunner& jobs);

// Fills the labels, tables and patches of `out`, and allocates the records, which are unpacked
// later from `parts`. The caller sets grid, palette and reach of `parts`; the rest is filled in.
Status read_surfaces(const ChunkReader& reader,
                     bool with_records,
                     JobRunner& jobs,
                     BlockParts* parts,
                     VoxelVolumes* out);

}  // namespace sonocase::detail
