// SPDX-License-Identifier: Apache-2.0

// Reads labels, tables and patches: `vox.*` of docs/format.md, part 2. For the
// .cpp files of formats/ only.
#pragma once

#include "formats/bundle/codec/block_parts.h"
#include "formats/bundle/codec/packed_volumes.h"

namespace sonocase::detail {

// Fills the labels and the tables of `out`, and allocates the records, which are unpacked later
// from `parts`. Of `parts`, grid, palette and reach are given; what the records need is added.
Status read_surfaces(const ChunkReader& reader,
                     bool with_records,
                     JobRunner& jobs,
                     BlockParts* parts,
                     VoxelVolumes* out);

}  // namespace sonocase::detail
