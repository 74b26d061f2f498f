// SPDX-License-Identifier: Apache-2.0

// Construction: which labels are near each block, and the distances that separate them.

#include "pipeline/segmentation/label_field.h"

#include <algorithm>
#include <array>
#include <atomic>
#include <cassert>
#include <cmath>
#include <map>
#include <type_traits>
#include <utility>

#include "pipeline/base/parallel.h"

namespace sonocase::pipeline::inline segmentation {

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
    : LabelField(labels, options, Unmeasured{}) {
    report_progress(progress, 0, "distances");
    hold(0, 0);
}

LabelFieldNeed LabelField::need(const LabelVolume& labels, const LabelFieldOptions& options) {
    const LabelField field(labels, options, Unmeasured{});
    constexpr double kScratchBytes = 26;
    const double phi = static_cast<double>(field.phi_) / 1e6,
                 bytes = field.step_mm_ > 0 ? sizeof(std::int16_t) : sizeof(float);
    struct Thread {
        std::size_t nodes = 0;  // of the largest piece so far
        double numbers = 0;
    };
    std::array<Thread, 2> threads;
    LabelFieldNeed need;
    for (std::size_t p = 0; p < field.pieces_.size(); ++p) {
        const Piece& piece = field.pieces_[p];
        Thread& thread = threads[p % 2];
        const double numbers = static_cast<double>(piece.blocks.size()) * phi;
        if (piece.part.count() < thread.nodes / 2) thread = {};
        thread.nodes = std::max(thread.nodes, piece.part.count());
        thread.numbers = std::max(thread.numbers, numbers);
        need.measured_mb =
            std::max(need.measured_mb,
                     need.held_mb + kScratchBytes * (threads[0].numbers + threads[1].numbers));
        need.held_mb += bytes * numbers;
    }
    return need;
}

LabelField::LabelField(const LabelVolume& labels, const LabelFieldOptions& options, Unmeasured)
    : distance_(labels, options.distance), nodes_(distance_.nodes()) {
    tree_ = nest_labels(source());
    volume_offsets_mm_.assign(label_count(), 0.0f);
    const bool many = nodes_.voxel_count() > options.max_float_nodes;
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
        per_mm_[a] = static_cast<float>(1 / nodes_.spacing_mm[a]);
    }
    blocks_.resize(static_cast<std::size_t>(block_count_.x) * block_count_.y * block_count_.z);
    const std::vector<LabelSet> swept = swept_labels();
    parallel_for(blocks_.size(), 64, [&](std::size_t begin, std::size_t end) {
        for (std::size_t b = begin; b < end; ++b) {
            list_labels(b, swept[b]);
            if (blocks_[b].labels.size() > 1) list_phis(&blocks_[b]);
        }
    });
    list_pieces();
}

// For each block, the labels with an outline that crosses it on its way from slice to slice.
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
                const VoxelBox& box = groups.outlines.outlines[o].box;
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
    layers_.resize((block_count_.z + blocks_per_layer_ - 1) / blocks_per_layer_);
    // Blocks that need each distance: first those of the edges, then the labels' own.
    const std::size_t label_count = this->label_count();
    std::vector<std::vector<std::uint32_t>> blocks_of(2 * label_count);
    for (std::size_t b = 0; b < blocks_.size(); ++b) {
        const Block& block = blocks_[b];
        if (block.labels.size() < 2) continue;
        layers_[layer_of(b)].size += (block.edges.size() + block.own.size()) * phi_;
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

// Layers: distances are measured layer by layer and given up again.

std::pair<std::size_t, std::size_t> LabelField::blocks_of_layer(int layer) const {
    const std::size_t first = static_cast<std::size_t>(layer) * blocks_in_layer();
    return {first, std::min(blocks_.size(), first + blocks_in_layer())};
}

bool LabelField::holds_all() const {
    return std::all_of(layers_.begin(), layers_.end(),
                       [](const Layer& layer) { return layer.held(); });
}

std::size_t LabelField::held_numbers() const {
    std::size_t sum = 0;
    for (const Layer& layer : layers_) sum += layer.held() ? layer.size : 0;
    return sum;
}

void LabelField::give_up(int layer) {
    Layer& left = layers_[layer];
    left.values.reset();
    left.steps.reset();
    left.has_candidates = false;
    const auto [first, last] = blocks_of_layer(layer);
    for (std::size_t b = first; b < last; ++b) {
        blocks_[b].values = nullptr;
        blocks_[b].steps = nullptr;
        blocks_[b].candidate_sets = {};
        blocks_[b].set_of_cell = {};
    }
}

void LabelField::hold(int first, int last) {
    std::vector<int> wanted;
    std::size_t held = held_numbers();
    for (int l = first; l <= last; ++l) {
        if (holds(l)) continue;
        wanted.push_back(l);
        held += layers_[l].size;
    }
    if (!wanted.empty()) {
        bool gave_up = false;
        while (held > room_) {
            int farthest = -1, distance = 0;
            for (int l = 0; l < layer_count(); ++l) {
                const int away = std::max(first - l, l - last);
                if (!holds(l) || away <= distance) continue;
                farthest = l;
                distance = away;
            }
            if (farthest < 0) break;
            held -= layers_[farthest].size;
            give_up(farthest);
            gave_up = true;
        }
        // Distances on boxes that reach through several layers are measured once for all of those
        // that come together.
        for (int away = 1; away < layer_count() && !gave_up; ++away) {
            for (const int l : {last + away, first - away}) {
                if (l < 0 || l >= layer_count() || holds(l)) continue;
                const std::size_t more = layers_[l].size;
                if (held + more > room_) continue;
                held += more;
                wanted.push_back(l);
            }
        }
        measure(wanted);
    }
    if (node_label_.empty()) return;  // nobody has asked for candidates
    for (int l = 0; l < layer_count(); ++l) {
        if (holds(l) && !layers_[l].has_candidates) find_layer_candidates(l);
    }
}

// Fills layers, one union of labels after another.
void LabelField::measure(const std::vector<int>& layers) {
    std::vector<char> wanted(layers_.size(), 0);
    for (const int l : layers) {
        Layer& layer = layers_[l];
        wanted[l] = 1;
        // Not cleared: every value is written below.
        const std::size_t room = std::max<std::size_t>(1, layer.size);
        if (step_mm_ > 0) {
            layer.steps = std::make_unique_for_overwrite<std::int16_t[]>(room + kBehind);
            std::fill_n(layer.steps.get() + room, kBehind, std::int16_t{0});
        } else {
            layer.values = std::make_unique_for_overwrite<float[]>(room);
        }
        std::size_t at = 0;
        const auto [first, last] = blocks_of_layer(l);
        for (std::size_t b = first; b < last; ++b) {
            Block& block = blocks_[b];
            if (block.labels.size() < 2) continue;
            block.values = step_mm_ > 0 ? nullptr : layer.values.get() + at;
            block.steps = step_mm_ > 0 ? layer.steps.get() + at : nullptr;
            at += (block.edges.size() + block.own.size()) * phi_;
        }
    }
    const auto in_layers = [&](std::uint32_t b) { return wanted[layer_of(b)] != 0; };
    std::vector<const Piece*> pieces;
    for (const Piece& piece : pieces_) {
        if (std::any_of(piece.blocks.begin(), piece.blocks.end(), in_layers))
            pieces.push_back(&piece);
    }
    const std::size_t label_count = this->label_count();
    const float beyond = static_cast<float>(distance_.limit_mm());
    // Each thread takes the next piece until all are taken, and keeps its scratch space, but not
    // that of a large piece through the many small ones, while the values fill.
    std::atomic<std::size_t> next{0};
    parallel_for(pieces.size(), 1, [&](std::size_t, std::size_t) {
        SparseBox phi;
        LabelDistance::Scratch scratch;
        std::vector<float> copied(step_mm_ > 0 ? phi_ : 0);
        NodeBlocks needed;
        needed.edge = block_edge();
        std::size_t kept = 0;  // nodes of the largest piece that the scratch space has served
        for (std::size_t p = next++; p < pieces.size(); p = next++) {
            const Piece& piece = *pieces[p];
            const bool own = piece.distance >= label_count;
            const auto l = static_cast<std::uint8_t>(piece.distance % label_count);
            if (piece.part.count() < kept / 2) {
                phi = {};
                scratch = {};
                kept = 0;
            }
            kept = std::max(kept, piece.part.count());
            phi.begin(piece.part, beyond, beyond);
            if (!piece.part.empty()) {
                needed.first.clear();
                for (const std::uint32_t b : piece.blocks) {
                    if (in_layers(b)) needed.first.push_back(blocks_[b].first);
                }
                distance_.distance_on(own ? one_label(l) : tree_.members[l], piece.part, &needed,
                                      &phi, &scratch);
            }
            for (const std::uint32_t b : piece.blocks) {
                if (!in_layers(b)) continue;
                const Block& block = blocks_[b];
                const auto& held = own ? block.own : block.edges;
                const std::size_t at = static_cast<std::size_t>(
                                           std::find(held.begin(), held.end(), l) - held.begin()) +
                                       (own ? block.edges.size() : 0);
                Layer& layer = layers_[layer_of(b)];
                if (step_mm_ > 0) {
                    copy_phi(phi, beyond, block.first, copied.data());
                    round_phi(copied.data(),
                              layer.steps.get() + (block.steps - layer.steps.get()) + at * phi_);
                } else {
                    copy_phi(phi, beyond, block.first,
                             layer.values.get() + (block.values - layer.values.get()) + at * phi_);
                }
            }
        }
    });
}

// Candidates: which labels can be near a point, for given volume offsets.

namespace {

// Candidates of a block that are within reach of a surface, one bit per candidate.
using Near = std::uint64_t;
constexpr std::size_t kNearBits = 64;

}  // namespace

// Distances that all the labels have in common are left out.
LabelField::CandidateSet LabelField::candidate_set(const Block& block,
                                                   const std::vector<std::uint8_t>& labels) const {
    CandidateSet set;
    set.labels = labels;
    std::vector<std::vector<std::uint16_t>> of_label(labels.size());
    const auto add = [&](std::size_t place, const auto& within) {
        std::size_t count = 0;
        for (const std::uint8_t l : labels) count += within(l);
        if (count == 0 || count == labels.size()) return;
        for (std::size_t i = 0; i < labels.size(); ++i) {
            if (within(labels[i]))
                of_label[i].push_back(static_cast<std::uint16_t>(set.phis.size()));
        }
        set.phis.push_back(static_cast<std::uint16_t>(place));
    };
    for (std::size_t e = 0; e < block.edges.size(); ++e)
        add(e, [&](std::uint8_t l) { return tree_.members[block.edges[e]][l]; });
    for (std::size_t e = 0; e < block.own.size(); ++e)
        add(block.edges.size() + e, [&](std::uint8_t l) { return l == block.own[e]; });
    if (block.labels.size() == 2 && labels.size() == 2) {
        // A label's own distance has to count here as it does elsewhere, or the same volume offset
        // would move surfaces by different amounts in different blocks. That distance is the
        // edge's for the label below the edge. For the other label it is the negative of the
        // edge's, which has the same effect as a further term of the label below.
        for (std::size_t i = 0; i < 2; ++i) {
            if (!tree_.between[labels[i]]) continue;
            auto& terms = of_label[of_label[i].empty() ? 1 - i : i];
            terms.insert(terms.begin(), terms.front());
        }
    }
    for (const auto& terms : of_label) {
        set.terms.insert(set.terms.end(), terms.begin(), terms.end());
        set.terms_end.push_back(static_cast<std::uint16_t>(set.terms.size()));
    }
    return set;
}

// Value of the spline through a block's values at the corners of its cells: a weighted mean of
// three values along each axis.
template <class Number>
void LabelField::read_corners(const Number* values, float* out) const {
    const float unit = std::is_same_v<Number, float> ? 1 : step_mm_;
    const auto mean = [](float a, float b, float c) { return (a + 4 * b + c) * (1.0f / 6); };
    const std::size_t corners = (std::size_t{1} << shift_) + 1;
    constexpr std::size_t kMax = 19 * 19;  // row_ * (block_edge() + 3) of a block of 16
    std::array<float, kMax * 19> rows;
    std::array<float, kMax> planes;
    for (std::size_t k = 0; k < corners + 2; ++k) {
        for (std::size_t v = 0; v < corners * row_; ++v) {
            const Number* p = values + k * plane_ + v;
            rows[k * plane_ + v] = mean(p[0], p[row_], p[2 * row_]);
        }
    }
    for (std::size_t k = 0; k < corners; ++k) {
        for (std::size_t v = 0; v < corners * row_; ++v) {
            const float* p = rows.data() + k * plane_ + v;
            planes[v] = mean(p[0], p[plane_], p[2 * plane_]);
        }
        for (std::size_t j = 0; j < corners; ++j) {
            for (std::size_t i = 0; i < corners; ++i) {
                const float* p = planes.data() + j * row_ + i;
                *out++ = unit * mean(p[0], p[1], p[2]);
            }
        }
    }
}

void LabelField::find_candidates(float reach_mm) {
    node_label_.assign(nodes_.voxel_count(), 0);
    node_margin_.assign(nodes_.voxel_count(), 255);
    reach_mm_ = reach_mm;
    for (Layer& layer : layers_) layer.has_candidates = false;
    hold(0, -1);
}

void LabelField::find_layer_candidates(int layer) {
    const auto [first, last] = blocks_of_layer(layer);
    const std::size_t from = first;
    parallel_for(last - first, 16, [&](std::size_t begin, std::size_t end) {
        std::vector<float> phi_at_corners;
        for (std::size_t b = from + begin; b < from + end; ++b)
            find_candidates(&blocks_[b], reach_mm_, &phi_at_corners);
    });
    layers_[layer].has_candidates = true;
}

void LabelField::find_candidates(Block* block, float reach_mm, std::vector<float>* phi_at_corners) {
    block->set_of_cell.clear();
    if (block->labels.size() < 2) {
        const int edge = block_edge();
        for (int k = block->first.z; k < std::min(block->first.z + edge, nodes_.size.z); ++k) {
            for (int j = block->first.y; j < std::min(block->first.y + edge, nodes_.size.y); ++j) {
                std::fill_n(node_label_.data() + nodes_.index(block->first.x, j, k),
                            std::min(edge, nodes_.size.x - block->first.x), block->labels[0]);
            }
        }
        return;
    }
    const auto corners = static_cast<std::size_t>(block_edge() + 1);
    const std::size_t corner_count = corners * corners * corners;
    block->candidate_sets = {candidate_set(*block, block->labels)};
    const std::vector<std::uint16_t>& phis = block->candidate_sets[0].phis;
    phi_at_corners->resize(phis.size() * corner_count);
    for (std::size_t e = 0; e < phis.size(); ++e) {
        float* out = phi_at_corners->data() + e * corner_count;
        if (block->values != nullptr) {
            read_corners(block->values + phis[e] * phi_, out);
        } else {
            read_corners(block->steps + phis[e] * phi_, out);
        }
    }
    // From any point of a cell to its nearest corner.
    const float reach = reach_mm + 0.5f * static_cast<float>(norm(nodes_.spacing_mm));
    std::vector<Near> near(corner_count);
    rank_corners(*block, reach, *phi_at_corners, &near);
    if (block->labels.size() <= kNearBits) divide_cells(block, near);
}

// Label and margin of the block's nodes; at each corner of its cells, the candidates that can win
// within reach.
void LabelField::rank_corners(const Block& block,
                              float reach,
                              const std::vector<float>& phi_at_corners,
                              std::vector<Near>* near) {
    const CandidateSet& all = block.candidate_sets[0];
    const std::size_t count = block.labels.size();
    const int edge = block_edge(), corners = edge + 1;
    const std::size_t corner_count = near->size();
    std::array<float, 256> score;
    std::array<float, 512> phis;
    std::size_t corner = 0;
    for (int k = 0; k < corners; ++k) {
        for (int j = 0; j < corners; ++j) {
            for (int i = 0; i < corners; ++i, ++corner) {
                for (std::size_t e = 0; e < all.phis.size(); ++e)
                    phis[e] = phi_at_corners[e * corner_count + corner];
                sum_terms(all, phis.data(), score.data());
                const auto best = static_cast<std::size_t>(
                    std::min_element(score.begin(), score.begin() + count) - score.begin());
                const std::uint8_t winner = block.labels[best];
                // Each phi changes by at most 1 mm per mm.
                float margin = 63;
                Near here = Near{1} << (best % kNearBits);
                for (std::size_t c = 0; c < count; ++c) {
                    if (c == best) continue;
                    const float m = (score[c] - score[best]) / slope(winner, block.labels[c]);
                    margin = std::min(margin, m);
                    if (m <= reach) here |= Near{1} << (c % kNearBits);
                }
                (*near)[corner] = here;
                const Int3 at{block.first.x + i, block.first.y + j, block.first.z + k};
                const bool of_block = i < edge && j < edge && k < edge;
                if (!of_block || !nodes_.contains(at.x, at.y, at.z)) continue;
                const std::size_t node = nodes_.index(at.x, at.y, at.z);
                node_label_[node] = winner;
                node_margin_[node] =
                    static_cast<std::uint8_t>(std::clamp(4 * margin, 0.0f, 254.0f));
            }
        }
    }
}

// Gives each cell the set of the candidates that are near one of its corners.
void LabelField::divide_cells(Block* block, const std::vector<Near>& near) const {
    const int edge = block_edge(), corners = edge + 1;
    std::vector<Near> sets{0};  // as in candidate_sets; the first, all of them, is never looked for
    block->set_of_cell.resize(edge * edge * edge);
    std::size_t cell = 0;
    for (int k = 0; k < edge; ++k) {
        for (int j = 0; j < edge; ++j) {
            for (int i = 0; i < edge; ++i, ++cell) {
                Near set = 0;
                for (int corner = 0; corner < 8; ++corner) {
                    set |= near[i + (corner & 1) +
                                corners * (j + (corner >> 1 & 1) + corners * (k + (corner >> 2)))];
                }
                auto found = std::find(sets.begin() + 1, sets.end(), set);
                if (found == sets.end()) {
                    if (sets.size() == 256) continue;  // no index is left: all candidates
                    std::vector<std::uint8_t> labels;
                    for (std::size_t c = 0; c < block->labels.size(); ++c) {
                        if (set >> c & 1) labels.push_back(block->labels[c]);
                    }
                    block->candidate_sets.push_back(candidate_set(*block, labels));
                    sets.push_back(set);
                    found = sets.end() - 1;
                }
                block->set_of_cell[cell] = static_cast<std::uint8_t>(found - sets.begin());
            }
        }
    }
}

// Evaluation at a point: the inner loop of resampling.

namespace {

// Four floats; the compiler turns each operation on them into one instruction where it can.
typedef float Four __attribute__((vector_size(16)));

Four load(const float* p) {
    Four v;
    __builtin_memcpy(&v, p, sizeof v);
    return v;
}

Four load(const std::int16_t* p) {
    typedef std::int16_t EightShort __attribute__((vector_size(16)));
    typedef std::int32_t FourInt __attribute__((vector_size(16)));
    EightShort v;  // only four are used: kBehind numbers follow the last one of a layer
    __builtin_memcpy(&v, p, sizeof v);
    // Each number stands twice in four bytes; the upper one is kept with its sign.
    const auto twice = __builtin_shufflevector(v, v, 0, 0, 1, 1, 2, 2, 3, 3);
    return __builtin_convertvector((FourInt)twice >> 16, Four);
}

void store(Four v, float* p) {
    __builtin_memcpy(p, &v, sizeof v);
}

// Weights of the cubic B-spline at position t of a cell, and their derivatives.
Four weights(float t) {
    const float s = 1 - t;
    return Four{s * s * s, 4 - 3 * t * t * (2 - t), 4 - 3 * s * s * (2 - s), t * t * t} *
           (1.0f / 6);
}

Four slopes(float t) {
    const float s = 1 - t;
    return Four{-s * s, t * (3 * t - 4), s * (4 - 3 * s), t * t} * 0.5f;
}

float sum(Four v) {
    return (v[0] + v[1]) + (v[2] + v[3]);
}

// The sums of four vectors at once.
Four sums(Four a, Four b, Four c, Four d) {
    const Four ab =
        __builtin_shufflevector(a, b, 0, 4, 1, 5) + __builtin_shufflevector(a, b, 2, 6, 3, 7);
    const Four cd =
        __builtin_shufflevector(c, d, 0, 4, 1, 5) + __builtin_shufflevector(c, d, 2, 6, 3, 7);
    return __builtin_shufflevector(ab, cd, 0, 1, 4, 5) +
           __builtin_shufflevector(ab, cd, 2, 3, 6, 7);
}

}  // namespace

LabelField::Position LabelField::locate(float x, float y, float z) const {
    Position p;
    const float v[3] = {x, y, z};
    std::size_t local[3];
    int cell[3];
    for (std::size_t a = 0; a < 3; ++a) {
        const int axis = static_cast<int>(a);
        const float c = std::clamp(v[a], 0.0f, static_cast<float>(nodes_.size[axis] - 1));
        cell[a] = static_cast<int>(c);
        p.t[a] = c - static_cast<float>(cell[a]);
        local[a] = static_cast<std::size_t>(cell[a] & (block_edge() - 1));
        store(weights(p.t[a]), p.weights[a].data());
    }
    p.block = &block_of(cell[0], cell[1], cell[2]);
    const std::size_t at = local[0] + ((local[1] + (local[2] << shift_)) << shift_);
    const std::vector<std::uint8_t>& set_of_cell = p.block->set_of_cell;
    if (!p.block->candidate_sets.empty())
        p.candidates = &p.block->candidate_sets[set_of_cell.empty() ? 0 : set_of_cell[at]];
    p.offset = local[0] + row_ * local[1] + plane_ * local[2];
    return p;
}

void LabelField::scores(const Position& position, float* out) const {
    assert(position.candidates != nullptr);
    if (step_mm_ > 0) {
        sum_scores(position, position.block->steps + position.offset, out);
    } else {
        sum_scores(position, position.block->values + position.offset, out);
    }
}

std::array<float, 4> LabelField::difference(const Position& position,
                                            std::size_t a,
                                            std::size_t b) const {
    return step_mm_ > 0
               ? weigh_difference(position, position.block->steps + position.offset, a, b)
               : weigh_difference(position, position.block->values + position.offset, a, b);
}

template <class Number>
void LabelField::sum_scores(const Position& position, const Number* values, float* out) const {
    const float unit = std::is_same_v<Number, float> ? 1 : step_mm_;
    const CandidateSet& set = *position.candidates;
    const auto& [wx, wy, wz] = position.weights;
    std::array<float, 512> phis;  // at most an edge and an own distance per label
    for (std::size_t e = 0; e < set.phis.size(); ++e) {
        const Number* phi = values + set.phis[e] * phi_;
        Four total{};
        for (std::size_t k = 0; k < 4; ++k) {
            const Number* p = phi + k * plane_;
            const Four plane = wy[0] * load(p) + wy[1] * load(p + row_) +
                               wy[2] * load(p + 2 * row_) + wy[3] * load(p + 3 * row_);
            total += wz[k] * plane;
        }
        phis[e] = unit * sum(total * load(wx.data()));
    }
    sum_terms(set, phis.data(), out);
}

template <class Number>
std::array<float, 4> LabelField::weigh_difference(const Position& position,
                                                  const Number* values,
                                                  std::size_t a,
                                                  std::size_t b) const {
    const float unit = std::is_same_v<Number, float> ? 1 : step_mm_;
    const CandidateSet& set = *position.candidates;
    const auto &wx = position.weights[0], &wy = position.weights[1], &wz = position.weights[2];
    const Four sx = slopes(position.t[0]), sy = slopes(position.t[1]), sz = slopes(position.t[2]);
    const Four w = load(wx.data());
    const Four per_mm{per_mm_[0], per_mm_[1], per_mm_[2], 0};
    Four mean{};
    float weights = 0, count = 0;
    const auto add = [&](std::size_t term, float sign) {
        const Number* phi = values + set.phis[term] * phi_;
        Four value{}, along_y{}, along_z{};
        for (std::size_t k = 0; k < 4; ++k) {
            const Number* p = phi + k * plane_;
            const Four q = load(p), r = load(p + row_), s = load(p + 2 * row_),
                       t = load(p + 3 * row_);
            const Four plane = wy[0] * q + wy[1] * r + wy[2] * s + wy[3] * t;
            value += wz[k] * plane;
            along_y += wz[k] * (sy[0] * q + sy[1] * r + sy[2] * s + sy[3] * t);
            along_z += sz[k] * plane;
        }
        const Four one = unit * sums(value * sx, along_y * w, along_z * w, value * w);
        const float square = sum((one * per_mm) * (one * per_mm)) + 1e-6f;  // never zero
        const float weight = square * square;
        mean += (sign * weight) * one;
        weights += weight;
        ++count;
    };
    // Terms that only one of the two labels has.
    const auto begin = [&](std::size_t l) { return l > 0 ? set.terms_end[l - 1] : 0u; };
    std::size_t i = begin(a), j = begin(b);
    const std::size_t i_end = set.terms_end[a], j_end = set.terms_end[b];
    while (i < i_end || j < j_end) {
        const std::size_t of_a = i < i_end ? set.terms[i] : set.phis.size();
        const std::size_t of_b = j < j_end ? set.terms[j] : set.phis.size();
        if (of_a != of_b) of_a < of_b ? add(of_a, -1) : add(of_b, 1);
        i += of_a <= of_b;
        j += of_b <= of_a;
    }
    mean *= count / weights;
    const std::vector<float>& offset = volume_offsets_mm_;
    return {mean[0], mean[1], mean[2], mean[3] + offset[set.labels[a]] - offset[set.labels[b]]};
}

}  // namespace sonocase::pipeline::inline segmentation
