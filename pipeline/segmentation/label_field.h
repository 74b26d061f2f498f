// SPDX-License-Identifier: Apache-2.0

// All labels of a map as one smooth partition of space that can be evaluated at any point.
//
//     score_l(x) = sum_e phi_e(x) - offset_l        label(x) = argmin_l score_l(x)
//
// phi_e     smooth signed distance (label_distance.h), mm, to the union of labels below edge e of
//           the label tree (label_tree.h), over the edges from the root to l; interpolated by the
//           cubic B-spline (C2)
// offset_l  volume offset, mm: one number per label that moves its surface outwards;
//           volume_correction.h chooses the offsets such that each label keeps its volume
//
// A label that the tree places between others that touch (LabelTree::between) also has a phi of
// its own, the distance to that label alone. Gaps and overlaps are impossible by construction.
//
// Storage: blocks of nodes. Only blocks near more than one label store distances; elsewhere one
// byte per node names the label. Distances come and go by layers of blocks (hold), such that memory
// goes with a few layers and not with the map; a layer that comes back has the same values.
//
// Between two labels, f = score_second - score_first is zero on their common surface, and
// f / |grad f| is the distance to it.
//
// Call find_candidates() before the first evaluation and after every change of the offsets, and
// hold() where not all layers are held.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <utility>
#include <vector>

#include "formats/volume/label_volume.h"
#include "pipeline/base/progress.h"
#include "pipeline/segmentation/distance/label_distance.h"
#include "pipeline/segmentation/label_tree.h"

namespace sonocase::pipeline::inline segmentation {

struct LabelFieldOptions {
    LabelDistanceOptions distance;
    // Nodes per edge of a block: 4, 8 or 16. For more than 30 million nodes, 8 counts as 16, which
    // takes less memory. Small blocks repeat much of their rims; large blocks hold distances
    // to labels that are far from most of their nodes.
    int block = 8;
    // Fields of more nodes hold distances as 16-bit numbers, a third of a thousandth of a voxel
    // apart: half the memory, in which larger tiles of them are measured at once.
    std::size_t max_float_nodes = 30'000'000;
    // Distances held at a time, MB; two layers are held whatever they take. Affects time and memory
    // alone.
    std::size_t held_mb = kAll;

    static constexpr std::size_t kAll = 1'000'000'000;
};

// What a field takes, known before a distance is measured.
struct LabelFieldNeed {
    double held_mb = 0;  // distances of all layers
    // Most while they are measured by two threads: what is held by then, and for each thread 26
    // bytes for every distance of the largest piece that its scratch space has served (measured on
    // nine maps; a piece of half the nodes gives that space up).
    double measured_mb = 0;
};

class LabelField {
  public:
    // What a field of these labels will take, in 30 ms for a million voxels.
    static LabelFieldNeed need(const LabelVolume& labels, const LabelFieldOptions& options);

    // `labels` must outlive it.
    LabelField(const LabelVolume& labels,
               const LabelFieldOptions& options,
               const Progress& progress = {});
    LabelField(LabelVolume&&, const LabelFieldOptions&, const Progress& = {}) = delete;

    const Grid& nodes() const { return nodes_; }
    const LabelVolume& source() const { return distance_.labels(); }  // slices along k
    int factor() const { return distance_.factor(); }                 // nodes per slice
    std::size_t label_count() const { return source().labels.size(); }

    // # labels, mm.
    std::vector<float>& volume_offsets_mm() { return volume_offsets_mm_; }
    const std::vector<float>& volume_offsets_mm() const { return volume_offsets_mm_; }

    // Labels that can be among the best two at a point, and the distances in which they differ.
    struct CandidateSet {
        std::vector<std::uint8_t> labels;
        std::vector<std::uint16_t> phis;       // indices of distances within the block
        std::vector<std::uint16_t> terms;      // label after label: indices into phis, ascending; a
                                               // distance may count two or three times
        std::vector<std::uint16_t> terms_end;  // # labels: end of each label's run in `terms`
    };
    struct Block {
        Int3 first;                        // its first node
        std::vector<std::uint8_t> labels;  // candidates; if only one, no distances are stored
        std::vector<std::uint8_t> edges;   // tree edges that separate candidates, by lower label
        std::vector<std::uint8_t> own;     // labels that have a phi of their own
        // One phi after another: edges, then own. One of the two where they are held, by the
        // field's kind of numbers.
        const float* values = nullptr;
        const std::int16_t* steps = nullptr;       // in step_mm_
        std::vector<CandidateSet> candidate_sets;  // the first holds all candidates
        std::vector<std::uint8_t> set_of_cell;     // block^3; empty: the first set everywhere
    };
    const std::vector<Block>& blocks() const { return blocks_; }
    int block_edge() const { return 1 << shift_; }  // nodes
    const Block& block_of(int i, int j, int k) const {
        return blocks_[block_index(i >> shift_, j >> shift_, k >> shift_)];
    }

    // Layers of blocks along k. Stacks of thick slices have one, since they are measured whole.
    int layer_count() const { return static_cast<int>(layers_.size()); }
    int layer_nodes() const { return blocks_per_layer_ << shift_; }
    bool holds(int layer) const { return layers_[layer].held(); }
    bool holds_all() const;
    // Blocks [first, second) of a layer.
    std::pair<std::size_t, std::size_t> blocks_of_layer(int layer) const;
    // Measures layers [first, last] where they are not held, gives up others where there is no
    // room, and measures more beside them where there is. Points can be evaluated only in blocks
    // that are held.
    void hold(int first, int last);

    // The cell of a point in node coordinates (clamped to the grid), with its spline weights.
    struct Position {
        const Block* block = nullptr;
        const CandidateSet* candidates = nullptr;  // null where the block has a single label
        std::size_t offset = 0;  // of the first of 4 x 4 x 4 values within the values of a phi
        std::array<std::array<float, 4>, 3> weights;
        std::array<float, 3> t;  // position within the cell, [0, 1)
    };
    Position locate(float x, float y, float z) const;

    // Score of each candidate at the position, up to a term common to all of them;
    // # candidates->labels. The position must have candidates.
    void scores(const Position& position, float* out) const;
    // Gradient per node, and value, of a function that is zero on the surface between two of the
    // candidates and rises into label a by slope() per mm: score_b - score_a where all phis that
    // separate the two agree. Where they disagree, one of them is bent by a wedge of a third label
    // that closes between two others, and the bend shortens its gradient. Each phi is therefore
    // weighted by the fourth power of the length of its gradient, such that the phi that continues
    // straight determines the surface and its normal. a, b: indices into candidates->labels.
    std::array<float, 4> difference(const Position& position, std::size_t a, std::size_t b) const;
    // Rate at which the scores of two labels separate near their surface, per mm.
    float slope(std::uint8_t a, std::uint8_t b) const {
        return static_cast<float>(tree_.steps_between(a, b) + tree_.between[a] + tree_.between[b]);
    }

    // For the current offsets: the label of each node with its margin, the distance (mm) within
    // which no other label can win, which answers most queries by one look-up; and for each cell
    // the few of its block's candidates whose surface may lie within reach_mm. Nodes and cells of
    // layers that are not held get theirs when they are; labels and margins stay.
    void find_candidates(float reach_mm);
    std::uint8_t node_label(std::size_t node) const { return node_label_[node]; }
    float node_margin_mm(std::size_t node) const {
        return 0.25f * static_cast<float>(node_margin_[node]);
    }

  private:
    struct Unmeasured {};
    LabelField(const LabelVolume& labels, const LabelFieldOptions& options, Unmeasured);

    std::size_t block_index(int x, int y, int z) const {  // block coordinates
        return x + static_cast<std::size_t>(block_count_.x) *
                       (y + static_cast<std::size_t>(block_count_.y) * z);
    }
    // Construction: which labels and distances each block holds, and their values.
    std::vector<LabelSet> swept_labels() const;
    void list_labels(std::size_t b, const LabelSet& swept);
    void list_phis(Block* block) const;
    // One distance on a part of the box in which it matters, and the blocks that take it there.
    struct Piece {
        std::size_t distance = 0;  // of a tree edge, or # labels + the label
        VoxelBox part;             // empty: the distance exceeds its limit in all the blocks
        std::vector<std::uint32_t> blocks;
    };
    void list_pieces();
    void cut_into_pieces(const std::vector<std::vector<std::uint32_t>>& blocks_of);
    VoxelBox nodes_of(const std::vector<std::uint32_t>& blocks, const VoxelBox& box) const;
    void copy_phi(const SparseBox& phi, float beyond, Int3 first, float* to) const;
    void round_phi(const float* phi, std::int16_t* to) const;
    // Layers of blocks. Some of them are held.
    static constexpr std::size_t kBehind = 4;  // numbers, since 16-bit ones are read by eight
    struct Layer {
        std::size_t size = 0;  // numbers
        std::unique_ptr<float[]> values;
        std::unique_ptr<std::int16_t[]> steps;
        bool held() const { return values != nullptr || steps != nullptr; }
        bool has_candidates = false;
    };
    int layer_of(std::size_t block) const { return static_cast<int>(block / blocks_in_layer()); }
    std::size_t blocks_in_layer() const {
        return static_cast<std::size_t>(block_count_.x) * block_count_.y * blocks_per_layer_;
    }
    std::size_t held_numbers() const;
    void give_up(int layer);
    void measure(const std::vector<int>& layers);
    // Candidates.
    void find_layer_candidates(int layer);
    CandidateSet candidate_set(const Block& block, const std::vector<std::uint8_t>& labels) const;
    template <class Number>
    void read_corners(const Number* values, float* out) const;
    // Evaluation.
    template <class Number>
    void sum_scores(const Position& position, const Number* values, float* out) const;
    template <class Number>
    std::array<float, 4> weigh_difference(const Position& position,
                                          const Number* values,
                                          std::size_t a,
                                          std::size_t b) const;
    void rank_corners(const Block& block,
                      float reach,
                      const std::vector<float>& phi_at_corners,
                      std::vector<std::uint64_t>* near);
    void find_candidates(Block* block, float reach_mm, std::vector<float>* phi_at_corners);
    void divide_cells(Block* block, const std::vector<std::uint64_t>& near) const;

    // Scores of candidates from the values of their phis.
    void sum_terms(const CandidateSet& set, const float* phis, float* out) const {
        std::size_t t = 0;
        for (std::size_t l = 0; l < set.labels.size(); ++l) {
            float score = -volume_offsets_mm_[set.labels[l]];
            for (; t < set.terms_end[l]; ++t) score += phis[set.terms[t]];
            out[l] = score;
        }
    }

    LabelDistance distance_;
    LabelTree tree_;
    Grid nodes_;
    int shift_ = 3;  // log2 of the block's edge
    // Values of one phi in a block, with the spline's neighbours: one node below and two above.
    std::size_t row_ = 0, plane_ = 0, phi_ = 0;  // floats per row, plane and phi
    std::array<float, 3> per_mm_{};              // nodes per mm
    Int3 block_count_;
    std::vector<Block> blocks_;
    std::vector<Piece> pieces_;
    int blocks_per_layer_ = 1;
    std::vector<Layer> layers_;
    std::size_t room_ = 0;  // numbers
    float step_mm_ = 0;     // of 16-bit numbers; 0: the field holds floats
    float reach_mm_ = 0;    // of the candidates
    std::vector<float> volume_offsets_mm_;
    std::vector<std::uint8_t> node_label_, node_margin_;
};

}  // namespace sonocase::pipeline::inline segmentation
