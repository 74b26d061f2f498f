// Tables of the echo offsets on their way out of a file: `ofs.*` of docs/format.md, part 2. For the
// .cpp files of formats/ only.
#pragma once

#include "formats/chunk_file.h"
#include "formats/detail/block_parts.h"

namespace sonocase::detail {

// Fills the table of `out` and makes room for its pool, which `parts` will fill.
Status read_offsets(const ChunkReader& reader,
                    int threads,
                    BlockParts* parts,
                    BrickVolume<std::int8_t>* out);

}  // namespace sonocase::detail
