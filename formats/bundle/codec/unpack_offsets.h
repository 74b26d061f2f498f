// SPDX-License-Identifier: Apache-2.0

// Tables of the echo offsets on their way out of a file: `ofs.*` of docs/format.md, part 2. For the
// .cpp files of formats/ only.
#pragma once

#include "formats/bundle/codec/block_parts.h"
#include "formats/container/chunk_file.h"

namespace sonocase::detail {

// Fills the table of `out` and makes room for its pool, which `parts` will fill.
Status read_offsets(const ChunkReader& reader,
                    JobRunner& jobs,
                    BlockParts* parts,
                    BrickVolume<std::int8_t>* out);

}  // namespace sonocase::detail
