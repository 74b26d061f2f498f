// SPDX-License-Identifier: Apache-2.0

#include "pipeline/segmentation/field/label_field.h"

#include <algorithm>
#include <atomic>
#include <cassert>
#include <cmath>
#include <limits>

#include "pipeline/base/parallel.h"

namespace sonocase::pipeline {
namespace {

// Four floats as one; the compiler turns each operation into one instruction where there is one.
typedef float Four __attribute__((vector_size(16)));

Four load(const float* p) {
    Four v;
    __builtin_memcpy(&v, p, sizeof v);
    return v;
}

void store(Four v, float* p) {
    __builtin_memcpy(p, &v, sizeof v);
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

// The sums of four vectors at once.
Four sums(Four a, Four b, Four c, Four d) {
    const Four ab =
        __builtin_shufflevector(a, b, 0, 4, 1, 5) + __builtin_shufflevector(a, b, 2, 6, 3, 7);
    const Four cd =
        __builtin_shufflevector(c, d, 0, 4, 1, 5) + __builtin_shufflevector(c, d, 2, 6, 3, 7);
    return __builtin_shufflevector(ab, cd, 0, 1, 4, 5) +
           __builtin_shufflevector(ab, cd, 2, 3, 6, 7);
}

// A label may win in a block if one of its voxels lies within this many of the block's nodes.
constexpr int kReach = 3;

// First and last of those voxels.
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
                       const Progress& progress) {
    report_progress(progress, 0, "distances");
    const LabelDistance distance(labels, options.distance);
    source_ = distance.labels();
    nodes_ = distance.nodes();
    factor_ = distance.factor();
    tree_ = nest_labels(source_);
    prices_.assign(source_.labels.size(), 0.0f);
    assert(options.block == 4 || options.block == 8 || options.block == 16);
    shift_ = options.block == 4 ? 2 : options.block == 8 ? 3 : 4;
    const int edge = block_edge(), field_nodes = edge + 3;
    row_ = static_cast<std::size_t>(edge + 4);  // padded
    plane_ = row_ * static_cast<std::size_t>(field_nodes);
    phi_ = plane_ * static_cast<std::size_t>(field_nodes);
    for (int a = 0; a < 3; ++a) {
        block_count_[a] = (nodes_.size[a] + edge - 1) >> shift_;
        per_mm_[static_cast<std::size_t>(a)] = static_cast<float>(1 / nodes_.spacing_mm[a]);
    }
    mark_candidates(distance);

    std::size_t values = 0;
    // First the edges, then labels alone.
    const std::size_t labels_count = source_.labels.size();
    std::vector<std::vector<std::uint32_t>> blocks_of(2 * labels_count);
    parallel_for(blocks_.size(), 64, [&](std::size_t begin, std::size_t end) {
        for (std::size_t b = begin; b < end; ++b) {
            if (blocks_[b].labels.size() > 1) list_phis(&blocks_[b]);
        }
    });
    for (std::size_t b = 0; b < blocks_.size(); ++b) {
        Block& block = blocks_[b];
        if (block.labels.size() < 2) continue;
        block.values = values;
        values += (block.edges.size() + block.alone.size()) * phi_;
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
    // Each thread that takes part takes the next label until there is none, with the same work
    // space.
    std::atomic<std::size_t> next{0};
    parallel_for(order.size(), 1, [&](std::size_t, std::size_t) {
        std::vector<float> phi;
        LabelDistance::Scratch work;
        for (std::size_t o = next++; o < order.size(); o = next++) {
            const bool alone = order[o] >= labels_count;
            const auto l = static_cast<std::uint8_t>(order[o] % labels_count);
            const VoxelBox box =
                distance.distance(alone ? one_label(l) : tree_.members[l], &phi, &work);
            for (const std::uint32_t b : blocks_of[order[o]]) {
                const Block& block = blocks_[b];
                const auto& terms = alone ? block.alone : block.edges;
                const std::size_t at =
                    static_cast<std::size_t>(std::find(terms.begin(), terms.end(), l) -
                                             terms.begin()) +
                    (alone ? block.edges.size() : 0);
                float* to = pool_.data() + block.values + at * phi_;
                for (int k = 0; k < field_nodes; ++k) {
                    const int z =
                        std::clamp(block.first.z - 1 + k, 0, nodes_.size.z - 1) - box.first.z;
                    for (int j = 0; j < field_nodes; ++j) {
                        const int y =
                            std::clamp(block.first.y - 1 + j, 0, nodes_.size.y - 1) - box.first.y;
                        const bool in = z >= 0 && z < box.size.z && y >= 0 && y < box.size.y;
                        float* row = to + static_cast<std::size_t>(k) * plane_ +
                                     static_cast<std::size_t>(j) * row_;
                        for (int i = 0; i < field_nodes; ++i) {
                            const int x = std::clamp(block.first.x - 1 + i, 0, nodes_.size.x - 1) -
                                          box.first.x;
                            row[i] =
                                in && x >= 0 && x < box.size.x ? phi[box.index(x, y, z)] : beyond;
                        }
                        row[field_nodes] = row[field_nodes - 1];
                    }
                }
            }
        }
    });
}

// Labels near a block, and those of which an outline is swept through it.
void LabelField::mark_candidates(const LabelDistance& distance) {
    const Grid& g = source_.grid;
    const int edge = block_edge();
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
    parallel_for(blocks_.size(), 64, [&](std::size_t begin, std::size_t end) {
        for (std::size_t b = begin; b < end; ++b) {
            const int x = static_cast<int>(b % static_cast<std::size_t>(block_count_.x));
            const int y = static_cast<int>(b / static_cast<std::size_t>(block_count_.x) %
                                           static_cast<std::size_t>(block_count_.y));
            const int z = static_cast<int>(b / static_cast<std::size_t>(block_count_.x) /
                                           static_cast<std::size_t>(block_count_.y));
            Block& block = blocks_[b];
            block.first = {x * edge, y * edge, z * edge};
            const auto [low, high] = voxels_near(block.first, edge, g.size, factor_);
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

void LabelField::list_phis(Block* block) const {
    LabelSet candidates;
    for (const std::uint8_t l : block->labels) candidates.set(l);
    for (std::size_t l = 0; l < tree_.parent.size(); ++l) {
        const std::size_t below = (candidates & tree_.members[l]).count();
        if (below > 0 && below < block->labels.size())
            block->edges.push_back(static_cast<std::uint8_t>(l));
    }
    // Where there are but two labels, either's own distance is that of the edge (see contest_of).
    for (const std::uint8_t l : block->labels) {
        if (block->labels.size() > 2 && tree_.between[l]) block->alone.push_back(l);
    }
}

// What the labels have in common is left out.
LabelField::CandidateSet LabelField::contest_of(const Block& block,
                                                const std::vector<std::uint8_t>& labels) const {
    CandidateSet contest;
    contest.labels = labels;
    std::vector<std::vector<std::uint16_t>> of_label(labels.size());
    const auto add = [&](std::size_t place, const auto& within) {
        std::size_t count = 0;
        for (const std::uint8_t l : labels) count += within(l);
        if (count == 0 || count == labels.size()) return;
        for (std::size_t i = 0; i < labels.size(); ++i) {
            if (within(labels[i]))
                of_label[i].push_back(static_cast<std::uint16_t>(contest.phis.size()));
        }
        contest.phis.push_back(static_cast<std::uint16_t>(place));
    };
    for (std::size_t e = 0; e < block.edges.size(); ++e)
        add(e, [&](std::uint8_t l) { return tree_.members[block.edges[e]][l]; });
    for (std::size_t e = 0; e < block.alone.size(); ++e)
        add(block.edges.size() + e, [&](std::uint8_t l) { return l == block.alone[e]; });
    if (block.labels.size() == 2 && labels.size() == 2) {
        // A label's own distance counts here as elsewhere: else prices would move surfaces by other
        // ways in other blocks. It is that of an edge below it, or what lacks to that of the
        // other's.
        for (std::size_t i = 0; i < 2; ++i) {
            if (!tree_.between[labels[i]]) continue;
            auto& terms = of_label[of_label[i].empty() ? 1 - i : i];
            terms.insert(terms.begin(), terms.front());
        }
    }
    for (const auto& terms : of_label) {
        contest.terms.insert(contest.terms.end(), terms.begin(), terms.end());
        contest.terms_end.push_back(static_cast<std::uint16_t>(contest.terms.size()));
    }
    return contest;
}

void LabelField::sum_terms(const CandidateSet& contest, const float* phis, float* out) const {
    std::size_t t = 0;
    for (std::size_t l = 0; l < contest.labels.size(); ++l) {
        float score = -prices_[contest.labels[l]];
        for (; t < contest.terms_end[l]; ++t) score += phis[contest.terms[t]];
        out[l] = score;
    }
}

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
    if (!p.block->contests.empty()) {
        p.contest =
            &p.block->contests[p.block->contest_of_cell.empty() ? 0 : p.block->contest_of_cell[at]];
    }
    p.offset = local[0] + row_ * local[1] + plane_ * local[2];
    return p;
}

void LabelField::scores(const Position& position, float* out) const {
    assert(position.contest != nullptr);
    const CandidateSet& contest = *position.contest;
    const auto& [wx, wy, wz] = position.weights;
    const float* values = pool_.data() + position.block->values + position.offset;
    std::array<float, 512> phis;  // each label may give an edge and one alone
    for (std::size_t e = 0; e < contest.phis.size(); ++e) {
        const float* phi = values + contest.phis[e] * phi_;
        Four total{};
        for (std::size_t k = 0; k < 4; ++k) {
            const float* p = phi + k * plane_;
            const Four plane = wy[0] * load(p) + wy[1] * load(p + row_) +
                               wy[2] * load(p + 2 * row_) + wy[3] * load(p + 3 * row_);
            total += wz[k] * plane;
        }
        phis[e] = sum(total * load(wx.data()));
    }
    sum_terms(contest, phis.data(), out);
}

std::array<float, 4> LabelField::difference(const Position& position,
                                            std::size_t a,
                                            std::size_t b) const {
    const CandidateSet& contest = *position.contest;
    const auto& [wx, wy, wz] = position.weights;
    const Four sx = slopes(position.t[0]), sy = slopes(position.t[1]), sz = slopes(position.t[2]);
    const Four w = load(wx.data());
    const float* values = pool_.data() + position.block->values + position.offset;
    const Four per_mm{per_mm_[0], per_mm_[1], per_mm_[2], 0};
    Four mean{};
    float weights = 0, count = 0;
    const auto add = [&](std::size_t term, float sign) {
        const float* phi = values + contest.phis[term] * phi_;
        Four value{}, along_y{}, along_z{};
        for (std::size_t k = 0; k < 4; ++k) {
            const float* p = phi + k * plane_;
            const Four q = load(p), r = load(p + row_), s = load(p + 2 * row_),
                       t = load(p + 3 * row_);
            const Four plane = wy[0] * q + wy[1] * r + wy[2] * s + wy[3] * t;
            value += wz[k] * plane;
            along_y += wz[k] * (sy[0] * q + sy[1] * r + sy[2] * s + sy[3] * t);
            along_z += sz[k] * plane;
        }
        const Four one = sums(value * sx, along_y * w, along_z * w, value * w);
        const float square = sum((one * per_mm) * (one * per_mm)) + 1e-6f;  // never nothing
        const float weight = square * square;
        mean += (sign * weight) * one;
        weights += weight;
        ++count;
    };
    // Terms of the one and not of the other.
    const auto begin = [&](std::size_t l) { return l > 0 ? contest.terms_end[l - 1] : 0u; };
    std::size_t i = begin(a), j = begin(b);
    const std::size_t i_end = contest.terms_end[a], j_end = contest.terms_end[b];
    while (i < i_end || j < j_end) {
        const std::size_t of_a = i < i_end ? contest.terms[i] : contest.phis.size();
        const std::size_t of_b = j < j_end ? contest.terms[j] : contest.phis.size();
        if (of_a != of_b) of_a < of_b ? add(of_a, -1) : add(of_b, 1);
        i += of_a <= of_b;
        j += of_b <= of_a;
    }
    mean *= count / weights;
    return {mean[0], mean[1], mean[2],
            mean[3] + prices_[contest.labels[a]] - prices_[contest.labels[b]]};
}

// The spline through a block's values, at the corners of its cells: a weighted mean of three along
// each axis.
void LabelField::read_corners(const float* values, float* out) const {
    const auto mean = [](float a, float b, float c) { return (a + 4 * b + c) * (1.0f / 6); };
    const std::size_t corners = (std::size_t{1} << shift_) + 1;
    constexpr std::size_t kLargest = 20 * 19;  // row_ * field_nodes
    std::array<float, kLargest * 19> rows;
    std::array<float, kLargest> planes;
    for (std::size_t k = 0; k < corners + 2; ++k) {
        for (std::size_t v = 0; v < corners * row_; ++v) {
            const float* p = values + k * plane_ + v;
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
                *out++ = mean(p[0], p[1], p[2]);
            }
        }
    }
}

void LabelField::find_contests(float reach_mm) {
    node_label_.assign(nodes_.voxel_count(), 0);
    node_margin_.assign(nodes_.voxel_count(), 255);
    parallel_for(blocks_.size(), 16, [&](std::size_t begin, std::size_t end) {
        std::vector<float> at_corners;
        for (std::size_t b = begin; b < end; ++b) find_contests(&blocks_[b], reach_mm, &at_corners);
    });
}

void LabelField::find_contests(Block* block, float reach_mm, std::vector<float>* at_corners) {
    // From any point of a cell to its nearest corner.
    const float reach = reach_mm + 0.5f * static_cast<float>(norm(nodes_.spacing_mm));
    const std::size_t count = block->labels.size();
    const int edge = block_edge(), corners = edge + 1;
    const auto corner_count = static_cast<std::size_t>(corners * corners * corners);
    using Near = std::uint64_t;  // candidates within reach of a surface
    const bool told = count > 1 && count <= 64;
    std::vector<Near> near(count > 1 ? corner_count : 0);
    block->contest_of_cell.clear();
    if (count > 1) {
        block->contests = {contest_of(*block, block->labels)};
        const std::size_t phis = block->contests[0].phis.size();
        at_corners->resize(phis * corner_count);
        for (std::size_t e = 0; e < phis; ++e) {
            read_corners(pool_.data() + block->values + block->contests[0].phis[e] * phi_,
                         at_corners->data() + e * corner_count);
        }
    }
    std::array<float, 256> score;
    std::array<float, 512> phis;
    for (int k = 0; k < corners; ++k) {
        for (int j = 0; j < corners; ++j) {
            for (int i = 0; i < corners; ++i) {
                const Int3 at{block->first.x + i, block->first.y + j, block->first.z + k};
                const bool own =
                    i < edge && j < edge && k < edge && nodes_.contains(at.x, at.y, at.z);
                if (count < 2) {
                    if (own) node_label_[nodes_.index(at.x, at.y, at.z)] = block->labels[0];
                    continue;
                }
                const CandidateSet& all = block->contests[0];
                const auto corner = static_cast<std::size_t>(i + corners * (j + corners * k));
                for (std::size_t e = 0; e < all.phis.size(); ++e)
                    phis[e] = (*at_corners)[e * corner_count + corner];
                sum_terms(all, phis.data(), score.data());
                const auto best = static_cast<std::size_t>(
                    std::min_element(score.begin(), score.begin() + count) - score.begin());
                const std::uint8_t winner = block->labels[best];
                // Each phi changes by at most 1 mm a mm.
                float margin = 63;
                Near here = Near{1} << (best & 63);
                for (std::size_t c = 0; c < count; ++c) {
                    if (c == best) continue;
                    const float m = (score[c] - score[best]) / slope(winner, block->labels[c]);
                    margin = std::min(margin, m);
                    if (m <= reach) here |= Near{1} << (c & 63);
                }
                near[corner] = here;
                if (!own) continue;
                const std::size_t node = nodes_.index(at.x, at.y, at.z);
                node_label_[node] = winner;
                node_margin_[node] =
                    static_cast<std::uint8_t>(std::clamp(4 * margin, 0.0f, 254.0f));
            }
        }
    }
    if (!told) return;
    std::vector<Near> sets{0};  // of contests; the first is never looked for
    block->contest_of_cell.resize(edge * edge * edge);
    std::size_t cell = 0;
    for (int k = 0; k < edge; ++k) {
        for (int j = 0; j < edge; ++j) {
            for (int i = 0; i < edge; ++i, ++cell) {
                Near set = 0;
                for (int corner = 0; corner < 8; ++corner) {
                    set |= near[static_cast<std::size_t>(
                        i + (corner & 1) +
                        corners * (j + (corner >> 1 & 1) + corners * (k + (corner >> 2))))];
                }
                auto found = std::find(sets.begin() + 1, sets.end(), set);
                if (found == sets.end()) {
                    if (sets.size() == 256) continue;  // too many to name: all candidates
                    std::vector<std::uint8_t> labels;
                    for (std::size_t c = 0; c < count; ++c) {
                        if (set >> c & 1) labels.push_back(block->labels[c]);
                    }
                    block->contests.push_back(contest_of(*block, labels));
                    sets.push_back(set);
                    found = sets.end() - 1;
                }
                block->contest_of_cell[cell] = static_cast<std::uint8_t>(found - sets.begin());
            }
        }
    }
}

}  // namespace sonocase::pipeline
