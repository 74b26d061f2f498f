// SPDX-License-Identifier: Apache-2.0

// Labels, tables and patches on their way out of a file: `vox.*` of docs/format.md, part 2. For the
// .cpp files of formats/ only.
#pragma once

#include "formats/bundle/codec/block_parts.h"
#include "formats/bundle/codec/packed_volumes.h"

namespace sonocase::detail {

// Fills the labels and the tables of `out`, and makes room for the records, which `parts` will
// fill:
// its grid, palette and reach are there, and what records need is added.
Status read_surfaces(const ChunkReader& reader,
                     bool with_records,
                     JobRunner& jobs,
                     BlockParts* parts,
                     VoxelVolumes* out);

}  // namespace sonocase::detail
