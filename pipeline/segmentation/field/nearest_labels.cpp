// SPDX-License-Identifier: Apache-2.0

#include "pipeline/segmentation/field/nearest_labels.h"

#include <cmath>

#include "pipeline/base/parallel.h"
#include "pipeline/registration/map/inverse_map.h"
#include "pipeline/segmentation/field/cooked_grid.h"

namespace sonocase::pipeline {

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
    const std::size_t rows =
        static_cast<std::size_t>(grid.size.y) * static_cast<std::size_t>(grid.size.z);
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
                                      const Registration& registration) {
    const Grid& g = ct_labels.grid;
    const std::size_t labels = ct_labels.labels.size();
    std::vector<std::vector<double>> slices(static_cast<std::size_t>(g.size.z));
    parallel_for(slices.size(), 1, [&](std::size_t begin, std::size_t end) {
        constexpr int kRun = 4;  // det J is smooth: one value serves a run of voxels
        for (std::size_t k = begin; k < end; ++k) {
            std::vector<double>& sum = slices[k];
            sum.assign(labels, 0.0);
            for (int j = 0; j < g.size.y; ++j) {
                const std::uint8_t* row =
                    ct_labels.voxels.data() + g.index(0, j, static_cast<int>(k));
                for (int i = 0; i < g.size.x; i += kRun) {
                    const int stop = std::min(g.size.x, i + kRun);
                    bool body = false;
                    for (int r = i; r < stop; ++r) body = body || row[r] != 0;
                    if (!body) continue;
                    const Point3 at = g.point_from_voxel(
                        {0.5 * (i + stop - 1), static_cast<double>(j), static_cast<double>(k)});
                    const double det = determinant(jacobian(registration, at));
                    for (int r = i; r < stop; ++r) sum[row[r]] += det;
                }
            }
        }
    });
    std::vector<double> out(labels, 0.0);
    for (const auto& slice : slices) {
        for (std::size_t l = 0; l < labels; ++l) out[l] += slice[l] * g.voxel_volume_mm3() / 1000;
    }
    return out;
}

}  // namespace sonocase::pipeline
