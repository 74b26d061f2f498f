// The brick volumes of a case on disk: labels and boundary records as surface patches wherever those
// give them back exactly, echo offsets as differences. docs/format.md, part 2.
#pragma once

#include <string>

#include "formats/brick_volume.h"
#include "formats/chunk_file.h"
#include "formats/detail/json_reader.h"

namespace sonocase::detail {

struct VoxelVolumes {
    BrickVolume<std::uint8_t> labels;
    BrickVolume<std::uint32_t> boundary;    // empty: none
    BrickVolume<std::int8_t> echo_offset;   // empty: none
};

// Adds the chunks, and to the manifest what is needed to read them. The order of the bricks in the
// pools and tables is not kept, their content is: what is read is as bricks_from_dense makes it.
void add_volumes(ChunkWriter& writer,
                 Json& manifest,
                 const BrickVolume<std::uint8_t>& labels,
                 const BrickVolume<std::uint32_t>& boundary,
                 const BrickVolume<std::int8_t>& echo_offset);

// size: of the grid. palette: number of labels; no label at or beyond it comes back. Files of the
// first layout (chunks lab.t and so on) are read too.
Result<VoxelVolumes> read_volumes(const ChunkReader& reader,
                                  JsonObject& manifest,
                                  Int3 size,
                                  std::size_t palette,
                                  int threads);

// The chunks that either layout may hold; for ChunkReader::open.
#define SONOCASE_VOLUME_CHUNKS                                                                  \
    "lab.t", "lab.u", "lab.p", "echo.t", "echo.u", "echo.p", "bnd.t", "bnd.u", "bnd.p",          \
        "vox.kind", "vox.one", "vox.mix", "vox.pair", "vox.low", "vox.high", "vox.rec",          \
        "ofs.kind", "ofs.one", "ofs.mix"

}  // namespace sonocase::detail
