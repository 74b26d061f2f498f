// SPDX-License-Identifier: Apache-2.0

#include "pipeline/segmentation/volume_correction.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <functional>
#include <utility>
#include <vector>

#include <Eigen/Cholesky>

#include "pipeline/base/parallel.h"

namespace sonocase::pipeline::inline segmentation {

namespace {

// How the voxels around the nodes of a field are cut into the cells over which volumes are
// integrated.
struct CellLayout {
    std::array<int, 3> per_node;  // cells per node along each axis, [1, 4]
    double volume_mm3 = 0;        // of a cell
    float size_mm = 0;            // edge of the cube of that volume

    // cell_mm: wanted edge of a cell.
    CellLayout(const Grid& nodes, double cell_mm);
    int count_per_node() const { return per_node[0] * per_node[1] * per_node[2]; }
};

// A cell near a surface: its three best labels for volume offsets of zero.
struct SurfaceCell {
    std::array<float, 3> score;
    std::array<std::uint8_t, 3> label;
    std::uint8_t count = 0;
};

// The cells of a block of the field.
struct BlockCells {
    double weight_mm3 = 0;                                  // volume of one cell
    double each = 1;                                        // cells that each one read stands for
    std::vector<SurfaceCell> near_surface;                  // cells that offsets can reassign
    std::vector<std::pair<std::uint8_t, double>> interior;  // label, mm^3 of its other cells
};

// Offsets separate two labels by up to twice the limit, and a cell is shared along a surface that
// is about as near as the cell is wide.
float surface_reach_mm(const CellLayout& layout, float limit_mm) {
    return 2 * limit_mm + 2 * layout.size_mm;
}

// Centre of a node's cell `at` of `of` along an axis, in nodes from the node.
float cell_centre(int at, int of) {
    return (static_cast<float>(at) + 0.5f) / static_cast<float>(of) - 0.5f;
}

// Keeps the three labels of the smallest scores, in order.
void insert(float score, std::uint8_t label, SurfaceCell* cell) {
    for (std::uint8_t r = 0; r < 3; ++r) {
        if (r == cell->count) {
            cell->score[r] = score;
            cell->label[r] = label;
            ++cell->count;
            return;
        }
        if (score < cell->score[r]) {
            std::swap(score, cell->score[r]);
            std::swap(label, cell->label[r]);
        }
    }
}

// Labels of fewer than 50,000 voxels, each of which is read.
LabelSet small_labels(const LabelVolume& source) {
    constexpr std::size_t kFew = 50'000, kPieces = 16;
    std::vector<std::array<std::size_t, 256>> counts(kPieces);
    parallel_for(kPieces, 1, [&](std::size_t begin, std::size_t end) {
        for (std::size_t piece = begin; piece < end; ++piece) {
            counts[piece].fill(0);
            const std::size_t last = source.voxels.size() * (piece + 1) / kPieces;
            for (std::size_t v = source.voxels.size() * piece / kPieces; v < last; ++v)
                ++counts[piece][source.voxels[v]];
        }
    });
    LabelSet small;
    for (std::size_t l = 0; l < 256; ++l) {
        std::size_t count = 0;
        for (const auto& piece : counts) count += piece[l];
        small[l] = count < kFew;
    }
    return small;
}

// Cuts the blocks of a field, one after another.
class BlockCutter {
  public:
    // full: labels in whose blocks every node is read; of other blocks one in four.
    BlockCutter(const LabelField& field,
                const CellLayout& layout,
                float limit_mm,
                const LabelSet& full)
        : field_(field), layout_(layout), limit_mm_(limit_mm), full_(full) {
        const Vector3 h = field.nodes().spacing_mm;
        certain_mm_ = surface_reach_mm(layout, limit_mm) + static_cast<float>(std::max(h.x, h.y));
    }

    void cut(const LabelField::Block& block,
             const std::function<double(Point3)>& weight,
             BlockCells* out) {
        const Grid& nodes = field_.nodes();
        Int3 count;
        for (int a = 0; a < 3; ++a)
            count[a] = std::min(field_.block_edge(), nodes.size[a] - block.first[a]);
        const Point3 middle = nodes.point_from_voxel({block.first.x + 0.5 * (count.x - 1),
                                                      block.first.y + 0.5 * (count.y - 1),
                                                      block.first.z + 0.5 * (count.z - 1)});
        out->weight_mm3 = layout_.volume_mm3 * weight(middle);
        if (block.labels.size() < 2) {
            const double all = static_cast<double>(count.x) * count.y * count.z;
            const auto& [x, y, z] = layout_.per_node;
            out->interior.emplace_back(block.labels[0], out->weight_mm3 * all * x * y * z);
            return;
        }
        interior_.fill(0);
        near_surface_.clear();
        const bool few = std::none_of(block.labels.begin(), block.labels.end(),
                                      [&](std::uint8_t l) { return full_[l]; });
        const int step = few ? 4 : 1;
        double read = 0;
        for (int k = 0; k < count.z; ++k) {
            for (int j = 0; j < count.y; ++j) {
                // Where one in four is read, every plane across an axis has its share of them.
                for (int i = few ? (2 * j + k) & 3 : 0; i < count.x; i += step, ++read)
                    cut_node({block.first.x + i, block.first.y + j, block.first.z + k});
            }
        }
        if (few && read > 0) out->each = static_cast<double>(count.x) * count.y * count.z / read;
        out->near_surface.assign(near_surface_.begin(), near_surface_.end());  // no larger
        for (std::size_t l = 0; l < 256; ++l) {
            if (interior_[l] > 0) {
                out->interior.emplace_back(static_cast<std::uint8_t>(l),
                                           interior_[l] * (out->each * out->weight_mm3));
            }
        }
    }

  private:
    void cut_node(Int3 node) {
        const std::size_t n = field_.nodes().index(node.x, node.y, node.z);
        if (field_.node_margin_mm(n) > certain_mm_) {
            interior_[field_.node_label(n)] += layout_.count_per_node();
            return;
        }
        const auto& [cells_x, cells_y, cells_z] = layout_.per_node;
        for (int z = 0; z < cells_z; ++z) {
            for (int y = 0; y < cells_y; ++y) {
                for (int x = 0; x < cells_x; ++x) {
                    const SurfaceCell cell =
                        read(static_cast<float>(node.x) + cell_centre(x, cells_x),
                             static_cast<float>(node.y) + cell_centre(y, cells_y),
                             static_cast<float>(node.z) + cell_centre(z, cells_z));
                    if (can_change(cell)) {
                        near_surface_.push_back(cell);
                    } else {
                        interior_[cell.label[0]] += 1;
                    }
                }
            }
        }
    }

    SurfaceCell read(float x, float y, float z) {
        const LabelField::Position at = field_.locate(x, y, z);
        SurfaceCell cell{};
        if (at.candidates == nullptr) {  // beyond the face of a block with a single label
            insert(0, at.block->labels[0], &cell);
            return cell;
        }
        field_.scores(at, score_.data());
        const std::vector<std::uint8_t>& labels = at.candidates->labels;
        for (std::size_t l = 0; l < labels.size(); ++l) insert(score_[l], labels[l], &cell);
        return cell;
    }

    bool can_change(const SurfaceCell& cell) const {
        return cell.count >= 2 &&
               !(cell.score[1] - cell.score[0] >
                 2 * limit_mm_ + layout_.size_mm * field_.slope(cell.label[0], cell.label[1]));
    }

    const LabelField& field_;
    const CellLayout& layout_;
    float limit_mm_;
    const LabelSet& full_;
    float certain_mm_;                    // no surface reaches a node's cells beyond this margin
    std::array<double, 256> interior_{};  // cells per label
    std::array<float, 256> score_{};
    std::vector<SurfaceCell> near_surface_;  // of the block
};

CellLayout::CellLayout(const Grid& nodes, double cell_mm) {
    for (int a = 0; a < 3; ++a) {
        per_node[a] =
            std::clamp(static_cast<int>(std::lround(nodes.spacing_mm[a] / cell_mm)), 1, 4);
    }
    volume_mm3 = nodes.voxel_volume_mm3() / count_per_node();
    size_mm = static_cast<float>(std::cbrt(volume_mm3));
}

// The cells of each block. # field.blocks(). limit_mm: largest offset that will be tried. The
// offsets of the field are zero and its candidates found for surface_reach_mm(). Holds the layers
// of the field one after another. some: reads one node in four, which counts for four, in blocks
// that are not near a label of fewer than 50,000 voxels. Same result for any number of threads.
std::vector<BlockCells> cut_into_cells(LabelField* field,
                                       const CellLayout& layout,
                                       float limit_mm,
                                       bool some,
                                       const std::function<double(Point3)>& weight) {
    const auto& blocks = field->blocks();
    std::vector<BlockCells> cells(blocks.size());
    const LabelSet full = some ? small_labels(field->source()) : ~LabelSet();
    const int layers = field->layer_count();
    const bool upwards = field->holds(0);  // from where layers are held
    for (int n = 0; n < layers; ++n) {
        const int layer = upwards ? n : layers - 1 - n;
        field->hold(std::max(0, layer - 1), layer);  // cells reach half a node down
        const auto [first, last] = field->blocks_of_layer(layer);
        const std::size_t from = first;
        parallel_for(last - first, 16, [&](std::size_t begin, std::size_t end) {
            BlockCutter cutter(*field, layout, limit_mm, full);
            for (std::size_t b = from + begin; b < from + end; ++b)
                cutter.cut(blocks[b], weight, &cells[b]);
        });
    }
    return cells;
}

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
    std::vector<std::vector<double>> slices(g.size.z);
    parallel_for(slices.size(), 1, [&](std::size_t begin, std::size_t end) {
        for (std::size_t s = begin; s < end; ++s) {
            const int k = static_cast<int>(s);
            std::vector<double>& volume = slices[s];
            volume.assign(field.label_count(), 0.0);
            // The nodes end at the first and last slices: only half of these counts.
            const bool rim = field.factor() > 1 && (k == 0 || k == g.size.z - 1);
            const double depth = rim ? 0.5 + 0.5 / field.factor() : 1;
            for (int j = 0; j < g.size.y; ++j) {
                const std::uint8_t* row = source.voxels.data() + g.index(0, j, k);
                // Weighted block by block like the cells, such that the targets can be reached.
                for (int i = 0; i < g.size.x; i += field.block_edge()) {
                    const int stop = std::min(g.size.x, i + field.block_edge());
                    const LabelField::Block& block = field.block_of(i, j, k * field.factor());
                    const double w = cells[&block - field.blocks().data()].weight_mm3 / cell_mm3;
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
            const double shared = volumes.coupling[l * labels + m];
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
        field, layout, limit, field->nodes().voxel_count() > options.max_read_nodes, weight);

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

}  // namespace sonocase::pipeline::inline segmentation
