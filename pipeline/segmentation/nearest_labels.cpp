// SPDX-License-Identifier: Apache-2.0

#include "pipeline/segmentation/nearest_labels.h"

#include <algorithm>
#include <cmath>

#include "pipeline/base/parallel.h"
#include "pipeline/registration/map/inverse_map.h"
#include "pipeline/segmentation/cooked_grid.h"

namespace sonocase::pipeline::inline segmentation {

LabelVolume nearest_labels(const LabelVolume& ct_labels,
                           const Registration& registration,
                           const Grid& grid,
                           PreimageCounts* counts,
                           const Progress& progress) {
    LabelVolume out;
    out.grid = grid;
    out.labels = ct_labels.labels;
    out.voxels.assign(grid.voxel_count(), 0);
    const InverseMap inverse_map(with_voxel_rim(registration, ct_labels.grid));
    const Grid& from = ct_labels.grid;
    const std::size_t nx = static_cast<std::size_t>(grid.size.x);
    const std::size_t rows = static_cast<std::size_t>(grid.size.y) * grid.size.z;
    std::vector<PreimageCounts> row_counts(rows);
    report_progress(progress, 0, "nearest labels");
    parallel_for(rows, 64, [&](std::size_t begin, std::size_t end) {
        std::vector<float> x(nx), y(nx), z(nx);
        std::vector<MapStatus> status(nx);
        for (std::size_t row = begin; row < end; ++row) {
            const int j = static_cast<int>(row % static_cast<std::size_t>(grid.size.y));
            const int k = static_cast<int>(row / static_cast<std::size_t>(grid.size.y));
            const Point3 start =
                grid.point_from_voxel({0, static_cast<double>(j), static_cast<double>(k)});
            const Vector3 step = grid.spacing_mm.x * grid.direction.column(0);
            inverse_map.invert_row(start, step, grid.size.x, x.data(), y.data(), z.data(),
                                   status.data());
            std::uint8_t* to = out.voxels.data() + grid.index(0, j, k);
            for (std::size_t i = 0; i < nx; ++i) {
                if (status[i] != MapStatus::ok) {
                    ++(status[i] == MapStatus::outside ? row_counts[row].outside
                                                       : row_counts[row].no_preimage);
                    continue;
                }
                const Point3 v = from.voxel_from_point({x[i], y[i], z[i]});
                const int a = static_cast<int>(std::lround(v.x));
                const int b = static_cast<int>(std::lround(v.y));
                const int c = static_cast<int>(std::lround(v.z));
                if (from.contains(a, b, c)) {
                    to[i] = ct_labels.voxels[from.index(a, b, c)];
                } else {
                    ++row_counts[row].outside;
                }
            }
        }
    });
    if (counts) {
        *counts = {};
        for (const PreimageCounts& c : row_counts) {
            counts->outside += c.outside;
            counts->no_preimage += c.no_preimage;
        }
    }
    report_progress(progress, 1, "nearest labels");
    return out;
}

std::vector<double> mapped_volumes_ml(const LabelVolume& ct_labels,
                                      const Registration& registration,
                                      std::size_t many) {
    const Grid& g = ct_labels.grid;
    const std::size_t labels = ct_labels.labels.size();
    Int3 box{4, 1, 1};
    if (g.voxel_count() > many) {
        const double wanted_mm[3] = {12, 3, 3};
        for (int a = 0; a < 3; ++a)
            box[a] = std::max(box[a], static_cast<int>(wanted_mm[a] / g.spacing_mm[a]));
    }
    std::vector<std::vector<double>> slabs((g.size.z - 1) / box.z + 1);
    const auto add_box = [&](Int3 first, std::vector<double>* sum) {
        Int3 stop;
        for (int a = 0; a < 3; ++a) stop[a] = std::min(g.size[a], first[a] + box[a]);
        const auto for_rows = [&](const auto& visit) {
            for (int k = first.z; k < stop.z; ++k) {
                for (int j = first.y; j < stop.y; ++j)
                    visit(ct_labels.voxels.data() + g.index(0, j, k));
            }
        };
        bool body = false;
        for_rows([&](const std::uint8_t* row) {
            for (int i = first.x; i < stop.x; ++i) body = body || row[i] != 0;
        });
        if (!body) return;
        const Point3 middle{0.5 * (first.x + stop.x - 1), 0.5 * (first.y + stop.y - 1),
                            0.5 * (first.z + stop.z - 1)};
        const double det = determinant(jacobian(registration, g.point_from_voxel(middle)));
        for_rows([&](const std::uint8_t* row) {
            for (int i = first.x; i < stop.x; ++i) (*sum)[row[i]] += det;
        });
    };
    parallel_for(slabs.size(), 1, [&](std::size_t begin, std::size_t end) {
        for (std::size_t s = begin; s < end; ++s) {
            slabs[s].assign(labels, 0.0);
            for (int j = 0; j < g.size.y; j += box.y) {
                for (int i = 0; i < g.size.x; i += box.x)
                    add_box({i, j, static_cast<int>(s) * box.z}, &slabs[s]);
            }
        }
    });
    std::vector<double> out(labels, 0.0);
    for (const auto& slab : slabs) {
        for (std::size_t l = 0; l < labels; ++l) out[l] += slab[l] * g.voxel_volume_mm3() / 1000;
    }
    return out;
}

}  // namespace sonocase::pipeline::inline segmentation
