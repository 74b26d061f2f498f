// SPDX-License-Identifier: Apache-2.0

#include "pipeline/anatomy/structure_cells.h"

#include <algorithm>
#include <vector>

#include "pipeline/base/parallel.h"

namespace sonocase::pipeline {

int structure_cell(double voxel_mm) {
    for (const int cell : {4, 2}) {
        if (cell * voxel_mm <= kStructureCellMm * 1.0001) return cell;
    }
    return 1;
}

Result<BakeStructureResult> bake_structure_in_cells(const LabelVolume& cooked,
                                                    std::span<const Tissue> tissues,
                                                    const BakeStructureOptions& options,
                                                    const Progress& progress) {
    const Grid& fine = cooked.grid;
    const int cell = structure_cell(fine.spacing_mm.x);
    if (cell == 1) return bake_structure(cooked, tissues, options, progress);
    LabelVolume coarse;
    coarse.labels = cooked.labels;
    coarse.grid = fine;
    for (int a = 0; a < 3; ++a) {
        coarse.grid.size[a] = (fine.size[a] + cell - 1) / cell;
        coarse.grid.spacing_mm[a] = cell * fine.spacing_mm[a];
    }
    const double middle = 0.5 * (cell - 1);
    coarse.grid.origin_mm = fine.point_from_voxel({middle, middle, middle});
    coarse.voxels.resize(coarse.grid.voxel_count());
    const auto inside = [&](int at, int size) { return std::min(at * cell + cell / 2, size - 1); };
    parallel_for(static_cast<std::size_t>(coarse.grid.size.z), 4,
                 [&](std::size_t b, std::size_t e) {
                     for (int k = static_cast<int>(b); k < static_cast<int>(e); ++k) {
                         for (int j = 0; j < coarse.grid.size.y; ++j) {
                             const std::uint8_t* row =
                                 cooked.voxels.data() +
                                 fine.index(0, inside(j, fine.size.y), inside(k, fine.size.z));
                             std::uint8_t* to = coarse.voxels.data() + coarse.grid.index(0, j, k);
                             for (int i = 0; i < coarse.grid.size.x; ++i)
                                 to[i] = row[inside(i, fine.size.x)];
                         }
                     }
                 });
    auto baked = bake_structure(coarse, tissues, options, progress);
    if (!baked) return baked;
    const std::vector<std::int8_t> values = dense_from_bricks(baked->echo_offset);
    std::vector<std::int8_t> offsets(fine.voxel_count());
    parallel_for(static_cast<std::size_t>(fine.size.z), 4, [&](std::size_t b, std::size_t e) {
        for (int k = static_cast<int>(b); k < static_cast<int>(e); ++k) {
            for (int j = 0; j < fine.size.y; ++j) {
                const std::int8_t* row = values.data() + coarse.grid.index(0, j / cell, k / cell);
                std::int8_t* to = offsets.data() + fine.index(0, j, k);
                for (int i = 0; i < fine.size.x; ++i) to[i] = row[i / cell];
            }
        }
    });
    baked->echo_offset = bricks_from_dense<std::int8_t>(offsets, fine.size);
    return baked;
}

}  // namespace sonocase::pipeline
