// SPDX-License-Identifier: Apache-2.0

// Labels and boundary records on their way into a file: `vox.*` of docs/format.md, part 2. For the
// .cpp files of formats/ only.
#pragma once

#include "formats/bundle/codec/packed_blocks.h"
#include "formats/container/chunk_file.h"
#include "formats/volume/surface_patch.h"

namespace sonocase::detail {

// Patches come from boundary.patches where those are known, else they are fitted. reach_steps: the
// largest distance of a record, in 1/48 voxel.
void add_surfaces(ChunkWriter& writer,
                  const BlockGrid& grid,
                  const BrickVolume<std::uint8_t>& labels,
                  const BoundaryBricks& boundary,
                  int reach_steps,
                  JobRunner& jobs);

}  // namespace sonocase::detail
