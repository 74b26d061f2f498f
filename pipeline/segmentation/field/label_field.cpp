// SPDX-License-Identifier: Apache-2.0

// Construction: which labels are near each block, and the distances that separate them.
#include "pipeline/segmentation/field/label_field.h"

#include <algorithm>
#include <array>
#include <cassert>
#include <map>
#include <utility>

#include "pipeline/base/parallel.h"

namespace sonocase::pipeline {
namespace {

// A label can win in a block if one of its voxels lies within this many voxels of the block.
constexpr int kReach = 3;

constexpr std::size_t kManyNodes = 30'000'000;  // from which memory decides the size of blocks

constexpr int kLayer = 128;  // nodes of a layer along k
// Nodes along an edge of the tiles that large distances are cut into. They are measured on some 35
// nodes more on each side, which small tiles repeat more of and large ones need room for.
constexpr int kTile = 128, kLargeTile = 256;

// First and last of the voxels within reach of a block.
std::pair<Int3, Int3> voxels_near(Int3 first, int block, Int3 size, int factor) {
    Int3 low, high;
    for (int a = 0; a < 3; ++a) {
        const int f = a == 2 ? factor : 1;
        const int reach = a == 2 && f > 1 ? 1 : kReach;
        low[a] = std::max(0, (first[a] - 1) / f - reach);
        high[a] = std::min(size[a] - 1, (first[a] + block + 1 + f - 1) / f + reach);
    }
    return {low, high};
}

}  // namespace

LabelField::LabelField(const LabelVolume& labels,
                       const LabelFieldOptions& options,
                       const Progress& progress)
    : distance_(labels, options.distance), nodes_(distance_.nodes()) {
    report_progress(progress, 0, "distances");
    tree_ = nest_labels(source());
    volume_offsets_mm_.assign(label_count(), 0.0f);
    const bool many = nodes_.voxel_count() > options.most_float_nodes;
    // Smoothing carries distances a little beyond their limit.
    if (many) step_mm_ = 1.25f * static_cast<float>(distance_.limit_mm()) / 32767;
    room_ = options.held_mb * 1'000'000 / (many ? sizeof(std::int16_t) : sizeof(float));
    assert(options.block == 4 || options.block == 8 || options.block == 16);
    shift_ = options.block == 4 ? 2 : options.block == 8 ? 3 : 4;
    if (shift_ == 3 && nodes_.voxel_count() > kManyNodes) shift_ = 4;
    const int edge = block_edge(), field_nodes = edge + 3;
    row_ = static_cast<std::size_t>(field_nodes);
    plane_ = row_ * static_cast<std::size_t>(field_nodes);
    phi_ = plane_ * static_cast<std::size_t>(field_nodes);
    for (int a = 0; a < 3; ++a) {
        block_count_[a] = (nodes_.size[a] + edge - 1) >> shift_;
        per_mm_[static_cast<std::size_t>(a)] = static_cast<float>(1 / nodes_.spacing_mm[a]);
    }
    blocks_.resize(static_cast<std::size_t>(block_count_.x) *
                   static_cast<std::size_t>(block_count_.y) *
                   static_cast<std::size_t>(block_count_.z));
    const std::vector<LabelSet> swept = swept_labels();
    parallel_for(blocks_.size(), 64, [&](std::size_t begin, std::size_t end) {
        for (std::size_t b = begin; b < end; ++b) {
            list_labels(b, swept[b]);
            if (blocks_[b].labels.size() > 1) list_phis(&blocks_[b]);
        }
    });
    list_pieces();
    hold(0, 0);
}

// Labels of which an outline is swept through each block on its way from slice to slice.
std::vector<LabelSet> LabelField::swept_labels() const {
    const int edge = block_edge();
    std::vector<LabelSet> swept(blocks_.size());
    const SliceGroups& groups = distance_.groups();
    for (std::size_t l = 0; l < groups.of_label.size(); ++l) {
        for (const SliceGroup& group : groups.of_label[l]) {
            Int3 low{1 << 30, 1 << 30, group.slice * factor()};
            Int3 high{-1, -1, (group.slice + 1) * factor()};
            for (const int o : {group.lower, group.upper}) {
                if (o < 0) continue;
                const VoxelBox& box = groups.outlines.outlines[static_cast<std::size_t>(o)].box;
                for (int a = 0; a < 2; ++a) {
                    low[a] = std::min(low[a], box.first[a]);
                    high[a] = std::max(high[a], box.first[a] + box.size[a]);
                }
            }
            for (int a = 0; a < 3; ++a) {
                low[a] = std::clamp((low[a] - kReach) / edge, 0, block_count_[a] - 1);
                high[a] = std::clamp((high[a] + kReach) / edge, 0, block_count_[a] - 1);
            }
            for (int z = low.z; z <= high.z; ++z) {
                for (int y = low.y; y <= high.y; ++y) {
                    for (int x = low.x; x <= high.x; ++x) swept[block_index(x, y, z)].set(l);
                }
            }
        }
    }
    return swept;
}

// Candidates of a block: the labels of the voxels near it and those swept through it.
void LabelField::list_labels(std::size_t b, const LabelSet& swept) {
    const Grid& g = source().grid;
    const int edge = block_edge();
    const int x = static_cast<int>(b % static_cast<std::size_t>(block_count_.x));
    const int y = static_cast<int>(b / static_cast<std::size_t>(block_count_.x) %
                                   static_cast<std::size_t>(block_count_.y));
    const int z = static_cast<int>(b / static_cast<std::size_t>(block_count_.x) /
                                   static_cast<std::size_t>(block_count_.y));
    Block& block = blocks_[b];
    block.first = {x * edge, y * edge, z * edge};
    const auto [low, high] = voxels_near(block.first, edge, g.size, factor());
    LabelSet present = swept;
    for (int k = low.z; k <= high.z; ++k) {
        for (int j = low.y; j <= high.y; ++j) {
            const std::uint8_t* row = source().voxels.data() + g.index(0, j, k);
            int last = -1;
            for (int i = low.x; i <= high.x; ++i) {
                if (row[i] != last) present.set(static_cast<std::size_t>(last = row[i]));
            }
        }
    }
    for (std::size_t l = 0; l < 256; ++l) {
        if (present[l]) block.labels.push_back(static_cast<std::uint8_t>(l));
    }
}

// Distances that a block of several candidates needs.
void LabelField::list_phis(Block* block) const {
    LabelSet candidates;
    for (const std::uint8_t l : block->labels) candidates.set(l);
    for (std::size_t l = 0; l < tree_.parent.size(); ++l) {
        const std::size_t below = (candidates & tree_.members[l]).count();
        if (below > 0 && below < block->labels.size())
            block->edges.push_back(static_cast<std::uint8_t>(l));
    }
    // With only two candidates, the distance of the edge is the own distance of either
    // (candidate_set).
    for (const std::uint8_t l : block->labels) {
        if (block->labels.size() > 2 && tree_.between[l]) block->own.push_back(l);
    }
}

// Which distances are measured where, and what each layer of blocks holds of them.
void LabelField::list_pieces() {
    blocks_per_layer_ =
        factor() > 1 ? block_count_.z : std::min(kLayer / block_edge(), block_count_.z);
    layers_.resize(
        static_cast<std::size_t>((block_count_.z + blocks_per_layer_ - 1) / blocks_per_layer_));
    // Blocks that need each distance: first those of the edges, then the labels' own.
    const std::size_t label_count = this->label_count();
    std::vector<std::vector<std::uint32_t>> blocks_of(2 * label_count);
    for (std::size_t b = 0; b < blocks_.size(); ++b) {
        const Block& block = blocks_[b];
        if (block.labels.size() < 2) continue;
        layers_[static_cast<std::size_t>(layer_of(b))].size +=
            (block.edges.size() + block.own.size()) * phi_;
        for (const std::uint8_t e : block.edges)
            blocks_of[e].push_back(static_cast<std::uint32_t>(b));
        for (const std::uint8_t l : block.own)
            blocks_of[label_count + l].push_back(static_cast<std::uint32_t>(b));
    }
    cut_into_pieces(blocks_of);
}

// Distances on small boxes are measured at once; on large ones tile by tile, where blocks need them
// and nowhere else. Pieces of many blocks come first, such that the last ones to finish are small.
void LabelField::cut_into_pieces(const std::vector<std::vector<std::uint32_t>>& blocks_of) {
    constexpr std::size_t kWhole = 10'000'000;  // nodes: some 400 MB of scratch space
    constexpr int kColumn = 64;                 // nodes; columns are as long as the stack
    const std::size_t label_count = this->label_count();
    std::vector<Piece>& pieces = pieces_;
    // Layers that come and go are no thicker than a tile.
    std::size_t all = 0;
    for (const Layer& layer : layers_) all += layer.size;
    const bool large = step_mm_ > 0 && all <= room_;
    for (std::size_t d = 0; d < blocks_of.size(); ++d) {
        if (blocks_of[d].empty()) continue;
        const bool own = d >= label_count;
        const auto l = static_cast<std::uint8_t>(d % label_count);
        const VoxelBox box = distance_.reach(own ? one_label(l) : tree_.members[l]);
        if (box.count() <= kWhole) {
            pieces.push_back({d, box, blocks_of[d]});
            continue;
        }
        const int edge = factor() > 1 ? kColumn : large ? kLargeTile : kTile;
        std::map<std::array<int, 3>, Piece> tiles;
        for (const std::uint32_t b : blocks_of[d]) {
            const Int3 first = blocks_[b].first;
            const std::array<int, 3> tile{first.z / edge * (factor() == 1), first.y / edge,
                                          first.x / edge};
            tiles[tile].blocks.push_back(b);
        }
        for (auto& [tile, piece] : tiles) {
            piece.distance = d;
            piece.part = nodes_of(piece.blocks, box);
            if (factor() > 1 && !piece.part.empty()) {
                piece.part.first.z = box.first.z;
                piece.part.size.z = box.size.z;
            }
            pieces.push_back(std::move(piece));
        }
    }
    std::stable_sort(pieces.begin(), pieces.end(), [&](const Piece& a, const Piece& b) {
        return a.blocks.size() > b.blocks.size();
    });
}

// The nodes of blocks and of their rims, as far as they lie in `box`.
VoxelBox LabelField::nodes_of(const std::vector<std::uint32_t>& blocks, const VoxelBox& box) const {
    VoxelBox out;
    for (int a = 0; a < 3; ++a) {
        int low = nodes_.size[a], high = -1;
        for (const std::uint32_t b : blocks) {
            low = std::min(low, blocks_[b].first[a] - 1);
            high = std::max(high, blocks_[b].first[a] + block_edge() + 1);
        }
        low = std::max(low, box.first[a]);
        out.first[a] = low;
        out.size[a] = std::min(high, box.first[a] + box.size[a] - 1) - low + 1;
    }
    return out;
}

// Copies the nodes of one block, with the rim that the spline needs, from a distance on a box.
// Nodes outside the box get the value `beyond`.
void LabelField::copy_phi(const SparseBox& phi, float beyond, Int3 first, float* to) const {
    const VoxelBox& box = phi.box();
    const int field_nodes = block_edge() + 3;
    for (int k = 0; k < field_nodes; ++k) {
        const int z = std::clamp(first.z - 1 + k, 0, nodes_.size.z - 1) - box.first.z;
        for (int j = 0; j < field_nodes; ++j) {
            const int y = std::clamp(first.y - 1 + j, 0, nodes_.size.y - 1) - box.first.y;
            const bool in = z >= 0 && z < box.size.z && y >= 0 && y < box.size.y;
            float* row =
                to + static_cast<std::size_t>(k) * plane_ + static_cast<std::size_t>(j) * row_;
            if (!in) {
                std::fill_n(row, field_nodes, beyond);
                continue;
            }
            const int start = first.x - 1 - box.first.x;
            if (start >= 0 && start + field_nodes <= box.size.x) {  // not beyond any border
                for (int i = 0; i < field_nodes;) {
                    const int at = (start + i) % SparseBox::kRun;
                    const int count = std::min(SparseBox::kRun - at, field_nodes - i);
                    const auto run = phi.run_index((start + i) / SparseBox::kRun, y, z);
                    std::copy_n(phi.values(phi.states()[run]) + at, count, row + i);
                    i += count;
                }
                continue;
            }
            for (int i = 0; i < field_nodes; ++i) {
                const int x = std::clamp(first.x - 1 + i, 0, nodes_.size.x - 1) - box.first.x;
                row[i] = x >= 0 && x < box.size.x ? phi.value(x, y, z) : beyond;
            }
        }
    }
}

// The values of one block as 16-bit numbers.
void LabelField::round_phi(const float* phi, std::int16_t* to) const {
    const float per_step = 1 / step_mm_;
    for (std::size_t n = 0; n < phi_; ++n) {
        const float steps = std::clamp(phi[n] * per_step, -32767.0f, 32767.0f);
        to[n] = static_cast<std::int16_t>(steps + (steps < 0 ? -0.5f : 0.5f));
    }
}

}  // namespace sonocase::pipeline
