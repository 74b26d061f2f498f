// SPDX-License-Identifier: Apache-2.0

// Label volumes of simple solids with known answers.
#pragma once

#include <functional>

#include "formats/volume/label_volume.h"

namespace sonocase::testing {

inline Grid cubic_grid(int edge, double spacing_mm = 1) {
    Grid grid;
    grid.size = {edge, edge, edge};
    grid.spacing_mm = {spacing_mm, spacing_mm, spacing_mm};
    const double low = -0.5 * spacing_mm * (edge - 1);
    grid.origin_mm = {low, low, low};
    return grid;
}

// Samples `label_at` at the voxel centres; a palette of `labels` entries.
inline LabelVolume sample_labels(const Grid& grid,
                                 int labels,
                                 const std::function<int(Point3)>& label_at) {
    LabelVolume volume;
    volume.grid = grid;
    for (int l = 0; l < labels; ++l) {
        volume.labels.push_back({l == 0 ? "outside" : "label_" + std::to_string(l), "", l, {}});
    }
    for (int k = 0; k < grid.size.z; ++k) {
        for (int j = 0; j < grid.size.y; ++j) {
            for (int i = 0; i < grid.size.x; ++i) {
                const Point3 p = grid.point_from_voxel(
                    {static_cast<double>(i), static_cast<double>(j), static_cast<double>(k)});
                volume.voxels.push_back(static_cast<std::uint8_t>(label_at(p)));
            }
        }
    }
    return volume;
}

inline double norm_of(Point3 p) {
    return norm(p - Point3{});
}

inline std::size_t count_label(const LabelVolume& volume, int label) {
    std::size_t count = 0;
    for (const std::uint8_t v : volume.voxels) count += v == label;
    return count;
}

}  // namespace sonocase::testing
