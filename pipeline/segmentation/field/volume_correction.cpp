// SPDX-License-Identifier: Apache-2.0

#include "pipeline/segmentation/field/volume_correction.h"

#include <Eigen/Cholesky>

#include <algorithm>
#include <cmath>

#include "pipeline/base/parallel.h"
#include "pipeline/segmentation/field/volume_cells.h"

namespace sonocase::pipeline {
namespace {

// Volumes of all labels, and what the volume offsets change in them.
struct Volumes {
    std::vector<double> mm3;       // # labels
    std::vector<double> coupling;  // # labels^2: d volume / d offset, mm^2, between two labels
};

// Volumes of the map's own voxels. Nodes between thick slices stand for a share of a slice.
std::vector<double> target_volumes(const LabelField& field,
                                   const std::vector<BlockCells>& cells,
                                   double cell_mm3) {
    const LabelVolume& source = field.source();
    const Grid& g = source.grid;
    const double voxel_mm3 = g.voxel_volume_mm3();
    std::vector<std::vector<double>> slices(static_cast<std::size_t>(g.size.z));
    parallel_for(slices.size(), 1, [&](std::size_t begin, std::size_t end) {
        for (std::size_t s = begin; s < end; ++s) {
            const int k = static_cast<int>(s);
            std::vector<double>& volume = slices[s];
            volume.assign(field.label_count(), 0.0);
            // The nodes end at the first and last slices, of which therefore only half counts.
            const bool rim = field.factor() > 1 && (k == 0 || k == g.size.z - 1);
            const double depth = rim ? 0.5 + 0.5 / field.factor() : 1;
            for (int j = 0; j < g.size.y; ++j) {
                const std::uint8_t* row = source.voxels.data() + g.index(0, j, k);
                // Weighted block by block like the cells, such that the targets can be reached.
                for (int i = 0; i < g.size.x; i += field.block_edge()) {
                    const int stop = std::min(g.size.x, i + field.block_edge());
                    const LabelField::Block& block = field.block_of(i, j, k * field.factor());
                    const double w =
                        cells[static_cast<std::size_t>(&block - field.blocks().data())].weight_mm3 /
                        cell_mm3;
                    for (int r = i; r < stop; ++r) volume[row[r]] += w * voxel_mm3 * depth;
                }
            }
        }
    });
    std::vector<double> target(field.label_count(), 0.0);
    for (const auto& slice : slices) {
        for (std::size_t l = 0; l < target.size(); ++l) target[l] += slice[l];
    }
    return target;
}

std::vector<double> interior_volumes(const std::vector<BlockCells>& cells, std::size_t labels) {
    std::vector<double> out(labels, 0.0);
    for (const BlockCells& block : cells) {
        for (const auto& [label, mm3] : block.interior) out[label] += mm3;
    }
    return out;
}

// Shares a cell between its two best labels under the present offsets.
void add_cell(const LabelField& field,
              const SurfaceCell& cell,
              double weight_mm3,
              float cell_mm,
              Volumes* sum) {
    const std::vector<float>& offset = field.volume_offsets_mm();
    float best = 1e30f, second = 1e30f;
    std::size_t l = 0, m = 0;
    for (std::size_t c = 0; c < cell.count; ++c) {
        const float score = cell.score[c] - offset[cell.label[c]];
        if (score < best) {
            second = best;
            m = l;
            best = score;
            l = cell.label[c];
        } else if (score < second) {
            second = score;
            m = cell.label[c];
        }
    }
    const float slope = field.slope(static_cast<std::uint8_t>(l), static_cast<std::uint8_t>(m));
    const float distance = (second - best) / slope;
    const float share = std::min(1.0f, 0.5f + distance / cell_mm);
    sum->mm3[l] += weight_mm3 * share;
    sum->mm3[m] += weight_mm3 * (1 - share);
    if (share < 1) {
        const std::size_t labels = sum->mm3.size();
        sum->coupling[l * labels + m] += weight_mm3 / (cell_mm * slope);
        sum->coupling[m * labels + l] += weight_mm3 / (cell_mm * slope);
    }
}

Volumes integrate(const LabelField& field,
                  const std::vector<BlockCells>& cells,
                  const std::vector<double>& interior_mm3,
                  float cell_mm) {
    const std::size_t labels = field.label_count();
    // Partial sums over a fixed number of pieces, added in order: the same for any thread count.
    constexpr std::size_t kPieces = 64;
    std::vector<Volumes> sums(kPieces);
    parallel_for(kPieces, 1, [&](std::size_t begin, std::size_t end) {
        for (std::size_t piece = begin; piece < end; ++piece) {
            Volumes& sum = sums[piece];
            sum.mm3.assign(labels, 0.0);
            sum.coupling.assign(labels * labels, 0.0);
            const std::size_t first = cells.size() * piece / kPieces;
            const std::size_t last = cells.size() * (piece + 1) / kPieces;
            for (std::size_t b = first; b < last; ++b) {
                for (const SurfaceCell& cell : cells[b].near_surface)
                    add_cell(field, cell, cells[b].each * cells[b].weight_mm3, cell_mm, &sum);
            }
        }
    });
    Volumes total{interior_mm3, std::vector<double>(labels * labels, 0.0)};
    for (const Volumes& sum : sums) {
        for (std::size_t l = 0; l < labels; ++l) total.mm3[l] += sum.mm3[l];
        for (std::size_t e = 0; e < labels * labels; ++e) total.coupling[e] += sum.coupling[e];
    }
    return total;
}

// Change of the offsets, mm, that brings the volumes to the targets if they were linear in the
// offsets. # labels.
std::vector<double> newton_step(const Volumes& volumes, const std::vector<double>& target_mm3) {
    const auto labels = static_cast<Eigen::Index>(target_mm3.size());
    Eigen::MatrixXd matrix(labels, labels);
    Eigen::VectorXd deficit = Eigen::VectorXd::Zero(labels);
    double total_deficit = 0, total_area = 0;
    for (Eigen::Index l = 0; l < labels; ++l) {
        const auto u = static_cast<std::size_t>(l);
        double area = 0;
        for (Eigen::Index m = 0; m < labels; ++m) {
            const double shared = volumes.coupling[static_cast<std::size_t>(l * labels + m)];
            matrix(l, m) = -shared;
            area += shared;
        }
        // A label that is absent, or has no surface, keeps its offset.
        matrix(l, l) += area > 0 ? area * 1.001 : 1;
        if (target_mm3[u] <= 0 || area <= 0) continue;
        deficit[l] = target_mm3[u] - volumes.mm3[u];
        total_deficit += deficit[l];
        total_area += area;
    }
    // Equal changes of all offsets change no volume: the deficit common to all labels cannot be
    // corrected, and would drive all offsets to their limits.
    for (Eigen::Index l = 0; l < labels; ++l) {
        if (deficit[l] != 0) deficit[l] -= total_deficit * (matrix(l, l) / 1.001) / total_area;
    }
    const Eigen::VectorXd change = matrix.ldlt().solve(deficit);
    return {change.data(), change.data() + labels};
}

double largest_error(const Volumes& volumes,
                     const std::vector<double>& target_mm3,
                     const std::vector<float>& offset_mm,
                     float limit_mm) {
    double largest = 0;
    for (std::size_t l = 0; l < target_mm3.size(); ++l) {
        if (target_mm3[l] <= 0 || std::abs(offset_mm[l]) >= limit_mm) continue;
        largest = std::max(largest, std::abs(volumes.mm3[l] / target_mm3[l] - 1));
    }
    return largest;
}

VolumeCorrectionReport correct_up_to(double limit_vx,
                                     LabelField* field,
                                     const std::function<double(Point3)>& weight,
                                     const VolumeCorrectionOptions& options) {
    const Vector3 h = field->nodes().spacing_mm;
    const float pixel = static_cast<float>(std::max(h.x, h.y));
    const float limit = static_cast<float>(limit_vx) * pixel;
    const CellLayout layout(field->nodes(), options.cell_mm);

    std::vector<float>& offset = field->volume_offsets_mm();
    std::fill(offset.begin(), offset.end(), 0.0f);
    field->find_candidates(surface_reach_mm(layout, limit));
    const std::vector<BlockCells> cells = cut_into_cells(
        field, layout, limit, field->nodes().voxel_count() > options.most_read_nodes, weight);

    VolumeCorrectionReport report;
    report.target_mm3 = target_volumes(*field, cells, layout.volume_mm3);
    const std::vector<double>& target = report.target_mm3;
    const std::vector<double> interior = interior_volumes(cells, target.size());
    for (int step = 0; step <= options.iterations; ++step) {
        const Volumes volumes = integrate(*field, cells, interior, layout.size_mm);
        report.reached_mm3 = volumes.mm3;
        report.iterations = step;
        report.largest_error = largest_error(volumes, target, offset, limit);
        if (step == options.iterations || report.largest_error < 1e-4) break;
        const std::vector<double> wanted = newton_step(volumes, target);
        const double stride = 0.3 * pixel;  // the linear model holds about this far
        for (std::size_t l = 0; l < target.size(); ++l) {
            double change = std::clamp(wanted[l], -stride, stride);
            if (target[l] > 0 && volumes.mm3[l] <= 0) change = stride;  // bring it back
            offset[l] = std::clamp(offset[l] + static_cast<float>(change), -limit, limit);
        }
    }
    return report;
}

}  // namespace

VolumeCorrectionReport correct_volumes(LabelField* field,
                                       const std::function<double(Point3)>& weight,
                                       const VolumeCorrectionOptions& options) {
    // Most maps need half a voxel, and a lower limit leaves fewer cells that it can change.
    const double usual_vx = std::min(0.7, options.max_offset_vx);
    VolumeCorrectionReport report = correct_up_to(usual_vx, field, weight, options);
    const Vector3 h = field->nodes().spacing_mm;
    const double limit = usual_vx * std::max(h.x, h.y);
    const auto& offsets = field->volume_offsets_mm();
    const bool reached = std::any_of(offsets.begin(), offsets.end(),
                                     [&](float o) { return std::abs(o) >= 0.999 * limit; });
    if (reached && usual_vx < options.max_offset_vx)
        report = correct_up_to(options.max_offset_vx, field, weight, options);
    return report;
}

}  // namespace sonocase::pipeline
