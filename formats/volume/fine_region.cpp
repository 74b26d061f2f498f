// SPDX-License-Identifier: Apache-2.0

#include "formats/volume/fine_region.h"

#include <cmath>

namespace sonocase {

Grid region_grid(const Box3& box, double voxel_mm) {
    Grid grid;
    grid.spacing_mm = {voxel_mm, voxel_mm, voxel_mm};
    for (int a = 0; a < 3; ++a) {
        const double low = std::floor(box.lower[a] / voxel_mm) - kRegionRim;
        const double high = std::ceil(box.upper[a] / voxel_mm) + kRegionRim;
        grid.origin_mm[a] = low * voxel_mm;
        grid.size[a] = static_cast<std::int32_t>(high - low) + 1;
    }
    return grid;
}

Status check_region(const FineRegion& region, double case_voxel_mm, const std::string& where) {
    const Vector3 h = region.grid.spacing_mm;
    if (h.x != h.y || h.x != h.z || region.grid.direction != Matrix3{})
        return Error{"the voxels of the fine region are not cubes along the axes", where,
                     "cook the case again"};
    if (!(h.x >= kMinRegionVoxelMm && h.x < case_voxel_mm))
        return Error{"the fine region has voxels of " + std::to_string(h.x) + " mm", where,
                     "0.1 mm or more, and less than the case's " + std::to_string(case_voxel_mm)};
    for (int a = 0; a < 3; ++a) {
        const double low = region.box.lower[a], high = region.box.upper[a];
        if (!(std::isfinite(low) && std::isfinite(high) && low < high))
            return Error{"the box of the fine region is empty", where, "cook the case again"};
        // A little less than the rim: the origin is rounded.
        const double rim = (kRegionRim - 0.01) * h.x, origin = region.grid.origin_mm[a];
        if (!(origin <= low - rim && origin + (region.grid.size[a] - 1) * h.x >= high + rim))
            return Error{"the grid of the fine region does not reach beyond its box", where,
                         "cook the case again"};
    }
    return Done{};
}

}  // namespace sonocase
