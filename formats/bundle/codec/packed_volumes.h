// SPDX-License-Identifier: Apache-2.0

// The brick volumes of a case on disk: labels and boundary records as surface patches with
// corrections, echo offsets as differences. docs/format.md, part 2.
#pragma once

#include <memory>

#include "formats/bundle/codec/chunk_file.h"
#include "formats/bundle/codec/packed_blocks.h"
#include "formats/text/json_reader.h"
#include "formats/volume/surface_patch.h"

namespace sonocase::detail {

struct VoxelVolumes {
    BrickVolume<std::uint8_t> labels;
    BoundaryBricks boundary;               // empty: none
    BrickVolume<std::int8_t> echo_offset;  // empty: none
    // VoxelBlocks unpacks the pools of the latter two from it; null: everything is loaded.
    std::unique_ptr<BlockParts> packed;
};

// Adds the chunks and, to the manifest, what is needed to read them. The order of bricks in the
// pools is not preserved; the values of the voxels are.
void add_volumes(ChunkWriter& writer,
                 Json& manifest,
                 const BrickVolume<std::uint8_t>& labels,
                 const BoundaryBricks& boundary,
                 const BrickVolume<std::int8_t>& echo_offset,
                 JobRunner& jobs);

// size: of the grid. palette: number of labels; no label at or beyond it comes back. The blocks
// refer to the reader's bytes. Files of the first layout (chunks lab.t and so on) are read too.
Result<VoxelVolumes> read_volumes(const ChunkReader& reader,
                                  JsonObject& manifest,
                                  Int3 size,
                                  std::size_t palette,
                                  JobRunner& jobs);

// The chunks that either layout may hold; for ChunkReader::open.
#define SONOCASE_VOLUME_CHUNKS                                                                     \
    "lab.t", "lab.u", "lab.p", "echo.t", "echo.u", "echo.p", "bnd.t", "bnd.u", "bnd.p",            \
        "vox.kind", "vox.one", "vox.mix", "vox.pair", "vox.low", "vox.high", "vox.fix", "vox.rec", \
        "ofs.kind", "ofs.one", "ofs.val"

}  // namespace sonocase::detail
