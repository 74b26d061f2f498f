#include "pipeline/segmentation/label_field.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "pipeline/parallel.h"

namespace sonocase::pipeline {
namespace {

// Four floats as one; the compiler turns each operation into one instruction where there is one.
typedef float Four __attribute__((vector_size(16)));

Four load(const float* p) {
    Four v;
    __builtin_memcpy(&v, p, sizeof v);
    return v;
}

// Weights of the cubic B-spline at fraction t, and their derivatives.
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

// A label may win in a block if one of its voxels lies within this many of the block's nodes.
constexpr int kReach = 3;

// First and last of those voxels.
std::pair<Int3, Int3> voxels_near(Int3 first, Int3 size, int factor) {
    Int3 low, high;
    for (int a = 0; a < 3; ++a) {
        const int f = a == 2 ? factor : 1;
        const int reach = a == 2 && f > 1 ? 1 : kReach;
        low[a] = std::max(0, (first[a] - 1) / f - reach);
        high[a] = std::min(size[a] - 1, (first[a] + kFieldBlock + 1 + f - 1) / f + reach);
    }
    return {low, high};
}

constexpr std::size_t kRowStride = kFieldRow;
constexpr std::size_t kPlaneStride = static_cast<std::size_t>(kFieldRow) * kFieldNodes;

}  // namespace

LabelField::LabelField(const LabelVolume& labels,
                       const LabelFieldOptions& options,
                       const Progress& progress) {
    tell(progress, 0, "distances");
    const LabelDistance distance(labels, options.distance);
    source_ = distance.labels();
    nodes_ = distance.nodes();
    factor_ = distance.factor();
    tree_ = nest_labels(source_);
    prices_.assign(source_.labels.size(), 0.0f);
    for (int a = 0; a < 3; ++a) block_count_[a] = (nodes_.size[a] + kFieldBlock - 1) / kFieldBlock;
    mark_candidates(distance);

    std::size_t values = 0;
    // First the edges, then labels alone.
    const std::size_t labels_count = source_.labels.size();
    std::vector<std::vector<std::uint32_t>> blocks_of(2 * labels_count);
    parallel_for(blocks_.size(), 64, [&](std::size_t begin, std::size_t end) {
        for (std::size_t b = begin; b < end; ++b) {
            if (blocks_[b].labels.size() > 1) list_terms(&blocks_[b]);
        }
    });
    for (std::size_t b = 0; b < blocks_.size(); ++b) {
        Block& block = blocks_[b];
        if (block.labels.size() < 2) continue;
        block.values = values;
        values += (block.edges.size() + block.alone.size()) * kFieldValues;
        for (const std::uint8_t e : block.edges)
            blocks_of[e].push_back(static_cast<std::uint32_t>(b));
        for (const std::uint8_t l : block.alone)
            blocks_of[labels_count + l].push_back(static_cast<std::uint32_t>(b));
    }
    pool_.resize(values);
    // The labels with the largest boxes first, so that the last ones to finish are small.
    std::vector<std::size_t> order;
    for (std::size_t l = 0; l < blocks_of.size(); ++l) {
        if (!blocks_of[l].empty()) order.push_back(l);
    }
    std::stable_sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) {
        return blocks_of[a].size() > blocks_of[b].size();
    });
    const float beyond = static_cast<float>(distance.limit_mm());
    parallel_for(order.size(), 1, [&](std::size_t begin, std::size_t end) {
        std::vector<float> phi;
        for (std::size_t o = begin; o < end; ++o) {
            const bool alone = order[o] >= labels_count;
            const auto l = static_cast<std::uint8_t>(order[o] % labels_count);
            const VoxelBox box = distance.distance(alone ? one_label(l) : tree_.members[l], &phi);
            for (const std::uint32_t b : blocks_of[order[o]]) {
                const Block& block = blocks_[b];
                const auto& terms = alone ? block.alone : block.edges;
                const std::size_t at =
                    static_cast<std::size_t>(std::find(terms.begin(), terms.end(), l) -
                                             terms.begin()) +
                    (alone ? block.edges.size() : 0);
                float* to = pool_.data() + block.values + at * kFieldValues;
                for (int k = 0; k < kFieldNodes; ++k) {
                    const int z =
                        std::clamp(block.first.z - 1 + k, 0, nodes_.size.z - 1) - box.first.z;
                    for (int j = 0; j < kFieldNodes; ++j) {
                        const int y =
                            std::clamp(block.first.y - 1 + j, 0, nodes_.size.y - 1) - box.first.y;
                        const bool in = z >= 0 && z < box.size.z && y >= 0 && y < box.size.y;
                        float* row = to + static_cast<std::size_t>(k) * kPlaneStride +
                                     static_cast<std::size_t>(j) * kRowStride;
                        for (int i = 0; i < kFieldNodes; ++i) {
                            const int x = std::clamp(block.first.x - 1 + i, 0, nodes_.size.x - 1) -
                                          box.first.x;
                            row[i] =
                                in && x >= 0 && x < box.size.x ? phi[box.index(x, y, z)] : beyond;
                        }
                        row[kFieldNodes] = row[kFieldNodes - 1];
                    }
                }
            }
        }
    });
    find_sure_nodes();
}

// Labels near a block, and those of which an outline is swept through it.
void LabelField::mark_candidates(const LabelDistance& distance) {
    const Grid& g = source_.grid;
    blocks_.resize(static_cast<std::size_t>(block_count_.x) *
                   static_cast<std::size_t>(block_count_.y) *
                   static_cast<std::size_t>(block_count_.z));
    std::vector<LabelSet> swept(blocks_.size());
    const auto block_index = [&](int x, int y, int z) {
        return static_cast<std::size_t>(x) +
               static_cast<std::size_t>(block_count_.x) *
                   (static_cast<std::size_t>(y) +
                    static_cast<std::size_t>(block_count_.y) * static_cast<std::size_t>(z));
    };
    for (std::size_t l = 0; l < distance.groups().of_label.size(); ++l) {
        for (const SliceGroup& group : distance.groups().of_label[l]) {
            Int3 low{1 << 30, 1 << 30, group.slice * factor_};
            Int3 high{-1, -1, (group.slice + 1) * factor_};
            for (const int o : {group.lower, group.upper}) {
                if (o < 0) continue;
                const VoxelBox& box = distance.groups().outlines[static_cast<std::size_t>(o)].box;
                for (int a = 0; a < 2; ++a) {
                    low[a] = std::min(low[a], box.first[a]);
                    high[a] = std::max(high[a], box.first[a] + box.size[a]);
                }
            }
            for (int a = 0; a < 3; ++a) {
                low[a] = std::clamp((low[a] - kReach) / kFieldBlock, 0, block_count_[a] - 1);
                high[a] = std::clamp((high[a] + kReach) / kFieldBlock, 0, block_count_[a] - 1);
            }
            for (int z = low.z; z <= high.z; ++z) {
                for (int y = low.y; y <= high.y; ++y) {
                    for (int x = low.x; x <= high.x; ++x) swept[block_index(x, y, z)].set(l);
                }
            }
        }
    }
    parallel_for(blocks_.size(), 64, [&](std::size_t begin, std::size_t end) {
        for (std::size_t b = begin; b < end; ++b) {
            const int x = static_cast<int>(b % static_cast<std::size_t>(block_count_.x));
            const int y = static_cast<int>(b / static_cast<std::size_t>(block_count_.x) %
                                           static_cast<std::size_t>(block_count_.y));
            const int z = static_cast<int>(b / static_cast<std::size_t>(block_count_.x) /
                                           static_cast<std::size_t>(block_count_.y));
            Block& block = blocks_[b];
            block.first = {x * kFieldBlock, y * kFieldBlock, z * kFieldBlock};
            const auto [low, high] = voxels_near(block.first, g.size, factor_);
            LabelSet present = swept[b];
            for (int k = low.z; k <= high.z; ++k) {
                for (int j = low.y; j <= high.y; ++j) {
                    const std::uint8_t* row = source_.voxels.data() + g.index(0, j, k);
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
    });
}

void LabelField::list_terms(Block* block) const {
    LabelSet candidates;
    for (const std::uint8_t l : block->labels) candidates.set(l);
    for (std::size_t l = 0; l < tree_.parent.size(); ++l) {
        const std::size_t below = (candidates & tree_.members[l]).count();
        if (below > 0 && below < block->labels.size())
            block->edges.push_back(static_cast<std::uint8_t>(l));
    }
    // Where two labels are alone, either's distance is that of the edge.
    for (const std::uint8_t l : block->labels) {
        if (block->labels.size() > 2 && tree_.between[l]) block->alone.push_back(l);
    }
    for (const std::uint8_t l : block->labels) {
        for (std::size_t e = 0; e < block->edges.size(); ++e) {
            if (tree_.members[block->edges[e]][l])
                block->terms.push_back(static_cast<std::uint16_t>(e));
        }
        for (std::size_t e = 0; e < block->alone.size(); ++e) {
            if (block->alone[e] == l)
                block->terms.push_back(static_cast<std::uint16_t>(block->edges.size() + e));
        }
        block->terms_end.push_back(static_cast<std::uint16_t>(block->terms.size()));
    }
}

float LabelField::block_score(const Block& block,
                              std::size_t candidate,
                              const float* values) const {
    float score = -prices_[block.labels[candidate]];
    for (std::size_t t = candidate > 0 ? block.terms_end[candidate - 1] : 0;
         t < block.terms_end[candidate]; ++t) {
        score += values[block.terms[t]];
    }
    return score;
}

LabelField::Position LabelField::locate(float x, float y, float z) const {
    Position p;
    const float v[3] = {x, y, z};
    std::size_t local[3];
    for (int a = 0; a < 3; ++a) {
        const float c = std::clamp(v[a], 0.0f, static_cast<float>(nodes_.size[a] - 1));
        const int cell = static_cast<int>(c);
        const auto u = static_cast<std::size_t>(a);
        p.cell[u] = cell;
        p.t[u] = c - static_cast<float>(cell);
        local[u] = static_cast<std::size_t>(cell % kFieldBlock);
    }
    p.block = &block_of(p.cell[0], p.cell[1], p.cell[2]);
    p.offset = local[0] + kRowStride * local[1] + kPlaneStride * local[2];
    return p;
}

void LabelField::scores(const Position& position, float* out) const {
    const Block& block = *position.block;
    if (block.labels.size() < 2) {
        out[0] = -1e3f;
        return;
    }
    const Four wx = weights(position.t[0]), wy = weights(position.t[1]),
               wz = weights(position.t[2]);
    const float* values = pool_.data() + block.values + position.offset;
    std::array<float, 512> edge;  // each label may give an edge and one alone
    for (std::size_t e = 0; e < block.edges.size() + block.alone.size();
         ++e, values += kFieldValues) {
        Four total{};
        for (std::size_t k = 0; k < 4; ++k) {
            const float* p = values + k * kPlaneStride;
            const Four plane = wy[0] * load(p) + wy[1] * load(p + kRowStride) +
                               wy[2] * load(p + 2 * kRowStride) + wy[3] * load(p + 3 * kRowStride);
            total += wz[k] * plane;
        }
        edge[e] = sum(total * wx);
    }
    for (std::size_t c = 0; c < block.labels.size(); ++c)
        out[c] = block_score(block, c, edge.data());
}

std::array<float, 4> LabelField::difference(const Position& position,
                                            std::size_t a,
                                            std::size_t b) const {
    const Block& block = *position.block;
    std::array<float, 4> out{0, 0, 0,
                             prices_[block.labels[a]] - prices_[block.labels[b]]};
    for (std::size_t e = 0; e < block.edges.size() + block.alone.size(); ++e) {
        const auto within = [&](std::uint8_t label) {
            return e < block.edges.size() ? tree_.members[block.edges[e]][label]
                                          : block.alone[e - block.edges.size()] == label;
        };
        const bool in_a = within(block.labels[a]), in_b = within(block.labels[b]);
        if (in_a == in_b) continue;
        const auto one = term_gradient(position, e);
        for (std::size_t i = 0; i < 4; ++i) out[i] += in_b ? one[i] : -one[i];
    }
    return out;
}

std::array<float, 4> LabelField::term_gradient(const Position& position, std::size_t term) const {
    const Four wx = weights(position.t[0]), wy = weights(position.t[1]),
               wz = weights(position.t[2]);
    const Four sx = slopes(position.t[0]), sy = slopes(position.t[1]), sz = slopes(position.t[2]);
    const float* values =
        pool_.data() + position.block->values + term * kFieldValues + position.offset;
    Four value{}, along_y{}, along_z{};
    for (std::size_t k = 0; k < 4; ++k) {
        const float* p = values + k * kPlaneStride;
        const Four a = load(p), b = load(p + kRowStride), c = load(p + 2 * kRowStride),
                   d = load(p + 3 * kRowStride);
        const Four plane = wy[0] * a + wy[1] * b + wy[2] * c + wy[3] * d;
        value += wz[k] * plane;
        along_y += wz[k] * (sy[0] * a + sy[1] * b + sy[2] * c + sy[3] * d);
        along_z += sz[k] * plane;
    }
    return {sum(value * sx), sum(along_y * wx), sum(along_z * wx), sum(value * wx)};
}

void LabelField::find_sure_nodes() {
    node_label_.assign(nodes_.voxel_count(), 0);
    node_margin_.assign(nodes_.voxel_count(), 255);
    parallel_for(blocks_.size(), 16, [&](std::size_t begin, std::size_t end) {
        std::vector<float> score(256), edge(512);
        for (std::size_t b = begin; b < end; ++b) {
            const Block& block = blocks_[b];
            for (int k = 0; k < kFieldBlock && block.first.z + k < nodes_.size.z; ++k) {
                for (int j = 0; j < kFieldBlock && block.first.y + j < nodes_.size.y; ++j) {
                    const std::size_t row =
                        nodes_.index(block.first.x, block.first.y + j, block.first.z + k);
                    const int width = std::min(kFieldBlock, nodes_.size.x - block.first.x);
                    for (int i = 0; i < width; ++i) {
                        const std::size_t node = row + static_cast<std::size_t>(i);
                        if (block.labels.size() < 2) {
                            node_label_[node] = block.labels[0];
                            continue;
                        }
                        // The stored value stands for the spline's at the node: they differ by less
                        // than the half voxel that the user of the margin adds.
                        const float* p = pool_.data() + block.values +
                                         static_cast<std::size_t>(k + 1) * kPlaneStride +
                                         static_cast<std::size_t>(j + 1) * kRowStride +
                                         static_cast<std::size_t>(i + 1);
                        for (std::size_t e = 0; e < block.edges.size() + block.alone.size();
                             ++e, p += kFieldValues)
                            edge[e] = *p;
                        std::size_t best = 0;
                        for (std::size_t c = 0; c < block.labels.size(); ++c) {
                            score[c] = block_score(block, c, edge.data());
                            if (score[c] < score[best]) best = c;
                        }
                        const std::uint8_t own = block.labels[best];
                        node_label_[node] = own;
                        // Each phi changes by at most 1 mm a mm.
                        float margin = 63;
                        for (std::size_t c = 0; c < block.labels.size(); ++c) {
                            if (c != best)
                                margin = std::min(margin, (score[c] - score[best]) /
                                                              slope(block, own, block.labels[c]));
                        }
                        node_margin_[node] =
                            static_cast<std::uint8_t>(std::clamp(4 * margin, 0.0f, 254.0f));
                    }
                }
            }
        }
    });
}

}  // namespace sonocase::pipeline
