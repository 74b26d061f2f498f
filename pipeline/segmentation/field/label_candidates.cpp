// SPDX-License-Identifier: Apache-2.0

// The part of label_field.h that finds, for given volume offsets, which labels can be near a point.
#include <algorithm>
#include <cmath>
#include <type_traits>

#include "pipeline/base/parallel.h"
#include "pipeline/segmentation/field/label_field.h"

namespace sonocase::pipeline {
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
    constexpr std::size_t kLargest = 19 * 19;  // row_ * (block_edge() + 3) of a block of 16
    std::array<float, kLargest * 19> rows;
    std::array<float, kLargest> planes;
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
    layers_[static_cast<std::size_t>(layer)].has_candidates = true;
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
                    set |= near[static_cast<std::size_t>(
                        i + (corner & 1) +
                        corners * (j + (corner >> 1 & 1) + corners * (k + (corner >> 2))))];
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

}  // namespace sonocase::pipeline
