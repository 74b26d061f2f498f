// SPDX-License-Identifier: Apache-2.0

#include "pipeline/segmentation/field/volume_correction.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "pipeline/base/parallel.h"

namespace sonocase::pipeline {
namespace {

// A cell near a surface: its three best labels at prices of zero.
struct Cell {
    std::array<float, 3> phi;
    std::array<std::uint8_t, 3> label;
    std::uint8_t count = 0;
};

struct BlockCells {
    double weight = 0;                                   // of one cell, mm^3
    std::vector<Cell> cells;                             // near a surface
    std::vector<std::pair<std::uint8_t, double>> whole;  // label, mm^3: far from any
};

// Solves a symmetric positive definite system in place by Gauss' elimination; n x n, row by row.
void solve(std::vector<double>* matrix, std::vector<double>* right, std::size_t n) {
    auto& a = *matrix;
    auto& b = *right;
    for (std::size_t i = 0; i < n; ++i) {
        for (std::size_t r = i + 1; r < n; ++r) {
            const double f = a[r * n + i] / a[i * n + i];
            if (f == 0) continue;
            for (std::size_t c = i; c < n; ++c) a[r * n + c] -= f * a[i * n + c];
            b[r] -= f * b[i];
        }
    }
    for (std::size_t i = n; i-- > 0;) {
        for (std::size_t c = i + 1; c < n; ++c) b[i] -= a[i * n + c] * b[c];
        b[i] /= a[i * n + i];
    }
}

LabelPriceReport prices_up_to(double most_vx,
                              LabelField* field,
                              const std::function<double(Point3)>& weight,
                              const LabelPriceOptions& options) {
    const std::size_t labels = field->label_count();
    const Grid& nodes = field->nodes();
    const LabelVolume& source = field->source();
    const Vector3 h = nodes.spacing_mm;
    const float pixel = static_cast<float>(std::max(h.x, h.y));
    const float limit = static_cast<float>(most_vx) * pixel;
    std::array<int, 3> parts;
    for (int a = 0; a < 3; ++a) {
        parts[static_cast<std::size_t>(a)] =
            std::clamp(static_cast<int>(std::lround(h[a] / options.cell_mm)), 1, 4);
    }
    const double cell_mm3 = nodes.voxel_volume_mm3() / (parts[0] * parts[1] * parts[2]);
    const float cell_mm = static_cast<float>(std::cbrt(cell_mm3));

    std::fill(field->prices().begin(), field->prices().end(), 0.0f);
    // Prices may part two labels by twice the limit, and a cell is shared along a surface that
    // near.
    field->find_contests(2 * limit + 2 * cell_mm);
    const auto& blocks = field->blocks();
    std::vector<BlockCells> held(blocks.size());
    parallel_for(blocks.size(), 16, [&](std::size_t begin, std::size_t end) {
        std::vector<float> score(256);
        for (std::size_t b = begin; b < end; ++b) {
            const LabelField::Block& block = blocks[b];
            BlockCells& out = held[b];
            Int3 count;
            for (int a = 0; a < 3; ++a) {
                count[a] = std::min(field->block_edge(), nodes.size[a] - block.first[a]);
            }
            const Point3 middle = nodes.point_from_voxel({block.first.x + 0.5 * (count.x - 1),
                                                          block.first.y + 0.5 * (count.y - 1),
                                                          block.first.z + 0.5 * (count.z - 1)});
            out.weight = cell_mm3 * weight(middle);
            if (block.labels.size() < 2) {
                const double all = static_cast<double>(count.x) * count.y * count.z;
                out.whole.emplace_back(block.labels[0],
                                       out.weight * all * parts[0] * parts[1] * parts[2]);
                continue;
            }
            std::array<double, 256> whole{};
            for (int k = 0; k < count.z; ++k) {
                for (int j = 0; j < count.y; ++j) {
                    for (int i = 0; i < count.x; ++i) {
                        const std::size_t node =
                            nodes.index(block.first.x + i, block.first.y + j, block.first.z + k);
                        if (field->node_margin_mm(node) > 2 * limit + 2 * cell_mm + pixel) {
                            whole[field->node_label(node)] += parts[0] * parts[1] * parts[2];
                            continue;
                        }
                        for (int c = 0; c < parts[2]; ++c) {
                            for (int d = 0; d < parts[1]; ++d) {
                                for (int e = 0; e < parts[0]; ++e) {
                                    const auto part = [](int at, int of) {
                                        return (static_cast<float>(at) + 0.5f) /
                                                   static_cast<float>(of) -
                                               0.5f;
                                    };
                                    const auto p = field->locate(
                                        static_cast<float>(block.first.x + i) + part(e, parts[0]),
                                        static_cast<float>(block.first.y + j) + part(d, parts[1]),
                                        static_cast<float>(block.first.z + k) + part(c, parts[2]));
                                    field->scores(p, score.data());
                                    Cell cell{};
                                    for (std::size_t l = 0; l < p.contest->labels.size(); ++l) {
                                        // Insert into the three best.
                                        float s = score[l];
                                        std::uint8_t label = p.contest->labels[l];
                                        for (std::uint8_t r = 0; r < 3; ++r) {
                                            if (r == cell.count) {
                                                cell.phi[r] = s;
                                                cell.label[r] = label;
                                                ++cell.count;
                                                break;
                                            }
                                            if (s < cell.phi[r]) {
                                                std::swap(s, cell.phi[r]);
                                                std::swap(label, cell.label[r]);
                                            }
                                        }
                                    }
                                    if (cell.count < 2 ||
                                        cell.phi[1] - cell.phi[0] >
                                            2 * limit + cell_mm * field->slope(cell.label[0],
                                                                               cell.label[1])) {
                                        whole[cell.label[0]] += 1;
                                    } else {
                                        out.cells.push_back(cell);
                                    }
                                }
                            }
                        }
                    }
                }
            }
            for (std::size_t l = 0; l < 256; ++l) {
                if (whole[l] > 0) {
                    out.whole.emplace_back(static_cast<std::uint8_t>(l), whole[l] * out.weight);
                }
            }
        }
    });

    LabelPriceReport report;
    report.target_mm3.assign(labels, 0.0);
    {  // targets: the map's own voxels; nodes of thick slices stand for a share of their slice
        const Grid& g = source.grid;
        const double share = g.voxel_volume_mm3();
        std::vector<std::vector<double>> slices(static_cast<std::size_t>(g.size.z));
        parallel_for(slices.size(), 1, [&](std::size_t begin, std::size_t end) {
            for (std::size_t s = begin; s < end; ++s) {
                const int k = static_cast<int>(s);
                std::vector<double>& volume = slices[s];
                volume.assign(labels, 0.0);
                // The nodes end at the first and last slice, so that these count by half there.
                const bool rim = field->factor() > 1 && (k == 0 || k == g.size.z - 1);
                const double depth = rim ? 0.5 + 0.5 / field->factor() : 1;
                for (int j = 0; j < g.size.y; ++j) {
                    const std::uint8_t* row = source.voxels.data() + g.index(0, j, k);
                    // Weighed like the cells, a block at a time: what is asked for can be reached.
                    for (int i = 0; i < g.size.x; i += field->block_edge()) {
                        const int stop = std::min(g.size.x, i + field->block_edge());
                        const LabelField::Block& block = field->block_of(i, j, k * field->factor());
                        const double w =
                            held[static_cast<std::size_t>(&block - blocks.data())].weight /
                            cell_mm3;
                        for (int r = i; r < stop; ++r) volume[row[r]] += w * share * depth;
                    }
                }
            }
        });
        for (const auto& slice : slices) {
            for (std::size_t l = 0; l < labels; ++l) report.target_mm3[l] += slice[l];
        }
    }

    std::vector<float>& price = field->prices();
    std::vector<double> fixed(labels, 0.0);
    for (const BlockCells& b : held) {
        for (const auto& [label, volume] : b.whole) fixed[label] += volume;
    }
    // Partial sums over a fixed number of pieces, added in order: the same for any thread count.
    constexpr std::size_t kPieces = 64;
    const std::size_t width = labels + labels * labels;
    for (int step = 0; step <= options.iterations; ++step) {
        std::vector<std::vector<double>> sums(kPieces);
        parallel_for(kPieces, 1, [&](std::size_t begin, std::size_t end) {
            for (std::size_t piece = begin; piece < end; ++piece) {
                std::vector<double>& s = sums[piece];
                s.assign(width, 0.0);
                const std::size_t first = held.size() * piece / kPieces;
                const std::size_t last = held.size() * (piece + 1) / kPieces;
                for (std::size_t b = first; b < last; ++b) {
                    for (const Cell& cell : held[b].cells) {
                        float best = 1e30f, second = 1e30f;
                        std::size_t l = 0, m = 0;
                        for (std::size_t c = 0; c < cell.count; ++c) {
                            const float score = cell.phi[c] - price[cell.label[c]];
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
                        const float slope = field->slope(static_cast<std::uint8_t>(l),
                                                         static_cast<std::uint8_t>(m));
                        const float distance = (second - best) / slope;
                        const float part = std::min(1.0f, 0.5f + distance / cell_mm);
                        const double w = held[b].weight;
                        s[l] += w * part;
                        s[m] += w * (1 - part);
                        if (part < 1) {  // d volume / d price
                            s[labels + l * labels + m] += w / (cell_mm * slope);
                            s[labels + m * labels + l] += w / (cell_mm * slope);
                        }
                    }
                }
            }
        });
        std::vector<double> volume = fixed;
        std::vector<double> matrix(labels * labels, 0.0);
        for (const auto& s : sums) {
            for (std::size_t l = 0; l < labels; ++l) volume[l] += s[l];
            for (std::size_t e = 0; e < labels * labels; ++e) matrix[e] -= s[labels + e];
        }
        report.reached_mm3 = volume;
        report.iterations = step;
        report.largest_miss = 0;
        for (std::size_t l = 0; l < labels; ++l) {
            if (report.target_mm3[l] <= 0 || std::abs(price[l]) >= limit) continue;
            report.largest_miss =
                std::max(report.largest_miss, std::abs(volume[l] / report.target_mm3[l] - 1));
        }
        if (step == options.iterations || report.largest_miss < 1e-4) break;
        std::vector<double> right(labels, 0.0);
        double all = 0, all_area = 0;
        for (std::size_t l = 0; l < labels; ++l) {
            double area = 0;
            for (std::size_t m = 0; m < labels; ++m) area -= matrix[l * labels + m];
            // A label without surface, or absent, has no say: its row reads price = 0 change.
            matrix[l * labels + l] += area > 0 ? area * 1.001 : 1;
            if (report.target_mm3[l] <= 0 || area <= 0) continue;
            right[l] = report.target_mm3[l] - volume[l];
            all += right[l];
            all_area += area;
        }
        // All prices as one change no volume: what all labels lack together is not to be had, and
        // would drive all of them to the limit.
        for (std::size_t l = 0; l < labels; ++l) {
            if (right[l] != 0) right[l] -= all * (matrix[l * labels + l] / 1.001) / all_area;
        }
        solve(&matrix, &right, labels);
        const double stride = 0.3 * pixel;  // the linear model holds about this far
        for (std::size_t l = 0; l < labels; ++l) {
            double change = std::clamp(right[l], -stride, stride);
            if (report.target_mm3[l] > 0 && volume[l] <= 0) change = stride;  // bring it back
            price[l] = std::clamp(price[l] + static_cast<float>(change), -limit, limit);
        }
    }
    return report;
}

}  // namespace

LabelPriceReport set_label_prices(LabelField* field,
                                  const std::function<double(Point3)>& weight,
                                  const LabelPriceOptions& options) {
    // Most maps need half a voxel, and the nearer the limit the fewer cells it can reach.
    const double enough_vx = std::min(0.7, options.max_price_vx);
    LabelPriceReport report = prices_up_to(enough_vx, field, weight, options);
    const Vector3 h = field->nodes().spacing_mm;
    const double limit = enough_vx * std::max(h.x, h.y);
    const auto& prices = field->prices();
    const bool reached = std::any_of(prices.begin(), prices.end(),
                                     [&](float p) { return std::abs(p) >= 0.999 * limit; });
    if (reached && enough_vx < options.max_price_vx)
        report = prices_up_to(options.max_price_vx, field, weight, options);
    return report;
}

}  // namespace sonocase::pipeline
