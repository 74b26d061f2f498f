// SPDX-License-Identifier: Apache-2.0

// All labels of a map as one smooth partition of space, to be read at any point.
//
//     score_l(x) = sum_e phi_e(x) - price_l        label(x) = argmin_l score_l(x)
// phi_e  smooth signed distance (label_distance.h) to the union of labels below an edge of the tree
//        of label_tree.h, over the edges from its root to l; read with the cubic B-spline (C2)
// price  one number a label, mm: shifts its surface outwards; label_prices.h picks them so that
//        each label keeps its volume
// A label that the tree puts between others that touch (LabelTree::between) carries the phi of
// itself alone as well.
// No gap and no overlap is possible. Only blocks that hold or touch two labels store anything;
// elsewhere one byte a node names the label.
// Between two labels f = score_second - score_first is zero on their surface, and f / |grad f| the
// distance to it. Before anything is read, and after prices change: find_contests().
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "formats/volume/label_volume.h"
#include "pipeline/base/progress.h"
#include "pipeline/segmentation/distance/label_distance.h"
#include "pipeline/segmentation/field/label_tree.h"

namespace sonocase::pipeline {

struct LabelFieldOptions {
    LabelDistanceOptions distance;
    // Nodes an edge: 4, 8 or 16. Small blocks repeat their rims, large ones hold distances to
    // labels that are far from most of their nodes.
    int block = 8;
};

class LabelField {
  public:
    LabelField(const LabelVolume& labels,
               const LabelFieldOptions& options,
               const Progress& progress = {});

    const Grid& nodes() const { return nodes_; }
    const LabelVolume& source() const { return source_; }  // slices along k
    int factor() const { return factor_; }                 // nodes a slice
    std::size_t label_count() const { return source_.labels.size(); }
    bool source_isotropic() const { return factor_ == 1; }

    std::vector<float>& prices() { return prices_; }
    const std::vector<float>& prices() const { return prices_; }

    // Labels among which the best two at a point are, and what parts them.
    struct CandidateSet {
        std::vector<std::uint8_t> labels;
        std::vector<std::uint16_t> phis;       // places in the block's values
        std::vector<std::uint16_t> terms;      // of each label in turn: places in phis, ascending,
                                               // some of them twice or three times
        std::vector<std::uint16_t> terms_end;  // # labels, in `terms`
    };
    struct Block {
        Int3 first;                        // node
        std::vector<std::uint8_t> labels;  // candidates; one: nothing is stored
        std::vector<std::uint8_t> edges;   // that part candidates: the label at their lower end
        std::vector<std::uint8_t> alone;   // labels that carry a phi of themselves alone
        std::size_t values = 0;  // into the pool, a phi after the other: edges, then alone
        std::vector<CandidateSet> contests;         // the first: all candidates
        std::vector<std::uint8_t> contest_of_cell;  // block^3; empty: the first
    };
    const std::vector<Block>& blocks() const { return blocks_; }
    int block_edge() const { return 1 << shift_; }  // nodes
    const Block& block_of(int i, int j, int k) const {
        return blocks_[static_cast<std::size_t>(i >> shift_) +
                       static_cast<std::size_t>(block_count_.x) *
                           (static_cast<std::size_t>(j >> shift_) +
                            static_cast<std::size_t>(block_count_.y) *
                                static_cast<std::size_t>(k >> shift_))];
    }

    // Where a point of node space (clamped to it) lies among the cells, with spline weights.
    struct Position {
        const Block* block = nullptr;
        const CandidateSet* contest = nullptr;
        std::size_t offset = 0;  // of the first of 4 x 4 x 4 values inside a phi's values
        std::array<std::array<float, 4>, 3> weights;
        std::array<float, 3> t;  // fraction of the cell
    };
    Position locate(float x, float y, float z) const;

    // Score of each label of the position's contest, but for a summand that they have in common;
    // # contest->labels.
    void scores(const Position& position, float* out) const;
    // Gradient per node, and value, of what is zero on the surface between two labels of the
    // contest and grows into a by slope() a mm: score_b - score_a where all phis that part them
    // agree. Where they do not, a wedge between other labels bends one of them, whose gradient
    // shortens by that: each phi counts by the fourth power of its gradient's length, so that the
    // one that goes on straight tells where the surface is and how it lies.
    std::array<float, 4> difference(const Position& position, std::size_t a, std::size_t b) const;
    // Near the surface between two labels their scores part by this much a mm.
    float slope(std::uint8_t a, std::uint8_t b) const {
        return static_cast<float>(tree_.steps_between(a, b) + tree_.between[a] + tree_.between[b]);
    }

    // With the prices as they are: how far (mm) from each node no other label can come near, which
    // answers most points by one look-up; and in each cell the contest of those labels of which a
    // surface may lie within reach_mm, which are few beside all of a block's.
    void find_contests(float reach_mm);
    // Label at the node and its margin.
    std::uint8_t node_label(std::size_t node) const { return node_label_[node]; }
    float node_margin_mm(std::size_t node) const {
        return 0.25f * static_cast<float>(node_margin_[node]);
    }

  private:
    void mark_candidates(const LabelDistance& distance);
    void list_phis(Block* block) const;
    void read_corners(const float* values, float* out) const;
    CandidateSet contest_of(const Block& block, const std::vector<std::uint8_t>& labels) const;
    void find_contests(Block* block, float reach_mm, std::vector<float>* at_corners);
    // Scores of a contest's labels from the values of its phis.
    void sum_terms(const CandidateSet& contest, const float* phis, float* out) const;

    LabelVolume source_;
    LabelTree tree_;
    Grid nodes_;
    int factor_ = 1;
    int shift_ = 3;  // log2 of a block's edge
    // A phi's values in a block: with the spline's neighbours, one node below and two above.
    std::size_t row_ = 0, plane_ = 0, phi_ = 0;  // floats
    std::array<float, 3> per_mm_{};              // nodes
    Int3 block_count_;
    std::vector<Block> blocks_;
    std::vector<float> pool_;
    std::vector<float> prices_;
    std::vector<std::uint8_t> node_label_, node_margin_;
};

}  // namespace sonocase::pipeline
