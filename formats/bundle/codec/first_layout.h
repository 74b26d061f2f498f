// SPDX-License-Identifier: Apache-2.0

// Brick volumes as files of the first layout hold them: chunks lab.*, bnd.* and echo.* with tables,
// uniform values and pools as they are in memory. Such files are read but no longer written.
#pragma once

#include "formats/bundle/codec/packed_volumes.h"

namespace sonocase::detail {

Result<VoxelVolumes> read_first_layout(const ChunkReader& reader,
                                       bool with_records,
                                       bool with_offsets,
                                       Int3 size,
                                       std::size_t palette,
                                       JobRunner& jobs);

}  // namespace sonocase::detail
