// SPDX-License-Identifier: Apache-2.0

// The chunk `region` of bundles and label files: a container of its own, kind FINE, with its
// manifest and packed volumes. docs/format.md, part 2. For the .cpp files of formats/ only.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "formats/base/jobs.h"
#include "formats/base/result.h"
#include "formats/volume/fine_region.h"

namespace sonocase::detail {

inline constexpr std::size_t kMaxRegionBytes = std::size_t{1} << 30;

std::vector<std::uint8_t> region_bytes(const FineRegion& region, JobRunner& jobs);

// Trusts nothing. palette: labels of the case. case_voxel_mm: edge of its voxels.
Result<FineRegion> region_from_bytes(std::span<const std::uint8_t> bytes,
                                     std::size_t palette,
                                     double case_voxel_mm,
                                     const std::string& where,
                                     JobRunner& jobs);

}  // namespace sonocase::detail
