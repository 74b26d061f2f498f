// SPDX-License-Identifier: Apache-2.0

// A fine region of the analytic phantom.
#pragma once

#include <utility>

#include "support/phantom_bundle.h"

namespace sonocase::testing {

// As the cooker leaves records: within 1.5 voxels of a surface.
inline BrickVolume<std::uint32_t> within_band(const BrickVolume<std::uint32_t>& records,
                                              double band_vx) {
    std::vector<std::uint32_t> dense = dense_from_bricks(records);
    for (std::uint32_t& r : dense) {
        if (r != kNoBoundary && unpack_boundary(r).distance_vx > band_vx) r = kNoBoundary;
    }
    return bricks_from_dense<std::uint32_t>(dense, records.size);
}

inline FineRegion phantom_region(PhantomOptions options, const Box3& box, double voxel_mm) {
    FineRegion region;
    region.name = "box";
    region.box = box;
    region.grid = region_grid(box, voxel_mm);
    const Int3 n = region.grid.size;
    options.voxel_mm = voxel_mm;
    options.structure = false;
    options.lower = region.grid.origin_mm;
    options.upper = options.lower + voxel_mm * Vector3{n.x - 0.5, n.y - 0.5, n.z - 0.5};
    CaseBundle fine = Phantom(options).bundle();
    region.label_bricks = std::move(fine.label_bricks);
    if (!fine.boundary.table.empty()) region.boundary = within_band(fine.boundary, 1.5);
    return region;
}

}  // namespace sonocase::testing
