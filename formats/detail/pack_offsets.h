// Echo offsets on their way into a file: `ofs.*` of docs/format.md, part 2. For the .cpp files of
// formats/ only.
#pragma once

#include "formats/chunk_file.h"
#include "formats/detail/packed_blocks.h"

namespace sonocase::detail {

void add_offsets(ChunkWriter& writer,
                 const BlockGrid& grid,
                 const BrickVolume<std::int8_t>& volume);

}  // namespace sonocase::detail
