// SPDX-License-Identifier: Apache-2.0

#include "documents/examples/crop_labels.h"

#include <algorithm>
#include <cassert>
#include <cmath>

namespace sonocase::pipeline {

Result<CropResult> crop_labels(const LabelVolume& input, const CropOptions& options) {
    assert(options.margin_mm >= 0);
    const Grid& grid = input.grid;
    Int3 low = grid.size, high{-1, -1, -1};
    for (int k = 0; k < grid.size.z; ++k)
        for (int j = 0; j < grid.size.y; ++j)
            for (int i = 0; i < grid.size.x; ++i) {
                if (input.voxels[grid.index(i, j, k)] == 0) continue;
                low = {std::min(low.x, i), std::min(low.y, j), std::min(low.z, k)};
                high = {std::max(high.x, i), std::max(high.y, j), std::max(high.z, k)};
            }
    if (high.x < 0) return Error{"every voxel is outside", "", "expected a body"};

    CropResult result;
    result.report.stage = "crop";
    result.report.version = kCropVersion;
    if (low.x == 0 || low.y == 0 || low.z == 0 || high.x == grid.size.x - 1 ||
        high.y == grid.size.y - 1 || high.z == grid.size.z - 1)
        result.report.warnings.push_back(
            "the body touches the border of its volume: it may have been cut before");
    const auto margin = [&](double spacing_mm) {
        return static_cast<int>(std::ceil(options.margin_mm / spacing_mm));
    };
    const Int3 m{margin(grid.spacing_mm.x), margin(grid.spacing_mm.y), margin(grid.spacing_mm.z)};
    low = {std::max(low.x - m.x, 0), std::max(low.y - m.y, 0), std::max(low.z - m.z, 0)};
    high = {std::min(high.x + m.x, grid.size.x - 1), std::min(high.y + m.y, grid.size.y - 1),
            std::min(high.z + m.z, grid.size.z - 1)};

    LabelVolume& out = result.volume;
    out.labels = input.labels;
    out.grid = grid;
    out.grid.size = {high.x - low.x + 1, high.y - low.y + 1, high.z - low.z + 1};
    out.grid.origin_mm = grid.point_from_voxel(
        {static_cast<double>(low.x), static_cast<double>(low.y), static_cast<double>(low.z)});
    out.voxels.reserve(out.grid.voxel_count());
    for (int k = low.z; k <= high.z; ++k)
        for (int j = low.y; j <= high.y; ++j) {
            const auto row =
                input.voxels.begin() + static_cast<std::ptrdiff_t>(grid.index(low.x, j, k));
            out.voxels.insert(out.voxels.end(), row, row + out.grid.size.x);
        }
    result.report.measures = {{"share_kept", static_cast<double>(out.grid.voxel_count()) /
                                                 static_cast<double>(grid.voxel_count())}};
    return result;
}

}  // namespace sonocase::pipeline
