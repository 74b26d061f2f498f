// SPDX-License-Identifier: Apache-2.0

// Reads the tables of the echo offsets: `ofs.*` of docs/format.md, part 2. For the
// .cpp files of formats/ only.
#pragma once

#include "formats/bundle/codec/block_parts.h"
#include "formats/container/chunk_file.h"

namespace sonocase::detail {

// Fills the table of `out` and allocates its pool, which is unpacked later from `parts`.
Status read_offsets(const ChunkReader& reader,
                    JobRunner& jobs,
                    BlockParts* parts,
                    BrickVolume<std::int8_t>* out);

}  // namespace sonocase::detail
