// SPDX-License-Identifier: Apache-2.0

#include "pipeline/segmentation/field/volume_cells.h"

#include <algorithm>
#include <cmath>

#include "pipeline/base/parallel.h"

namespace sonocase::pipeline {
namespace {

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

// Labels of so few voxels that each of them counts.
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

}  // namespace

CellLayout::CellLayout(const Grid& nodes, double cell_mm) {
    for (int a = 0; a < 3; ++a) {
        per_node[static_cast<std::size_t>(a)] =
            std::clamp(static_cast<int>(std::lround(nodes.spacing_mm[a] / cell_mm)), 1, 4);
    }
    volume_mm3 = nodes.voxel_volume_mm3() / count_per_node();
    size_mm = static_cast<float>(std::cbrt(volume_mm3));
}

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

}  // namespace sonocase::pipeline
