// SPDX-License-Identifier: Apache-2.0

// Echo offsets on their way into a file: `ofs.*` of docs/format.md, part 2. For the .cpp files of
// formats/ only.
#pragma once

#include "formats/bundle/codec/packed_blocks.h"
#include "formats/container/chunk_file.h"

namespace sonocase::detail {

void add_offsets(ChunkWriter& writer,
                 const BlockGrid& grid,
                 const BrickVolume<std::int8_t>& volume,
                 JobRunner& jobs);

}  // namespace sonocase::detail
