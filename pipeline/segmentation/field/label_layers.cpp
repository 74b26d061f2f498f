// SPDX-License-Identifier: Apache-2.0

// The part of label_field.h that measures distances layer by layer and gives them up again.
#include <algorithm>
#include <atomic>

#include "pipeline/base/parallel.h"
#include "pipeline/segmentation/field/label_field.h"

namespace sonocase::pipeline {

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
    Layer& left = layers_[static_cast<std::size_t>(layer)];
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
        held += layers_[static_cast<std::size_t>(l)].size;
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
            held -= layers_[static_cast<std::size_t>(farthest)].size;
            give_up(farthest);
            gave_up = true;
        }
        // Distances on boxes that reach through several layers are measured once for all of those
        // that come together.
        for (int away = 1; away < layer_count() && !gave_up; ++away) {
            for (const int l : {last + away, first - away}) {
                if (l < 0 || l >= layer_count() || holds(l)) continue;
                const std::size_t more = layers_[static_cast<std::size_t>(l)].size;
                if (held + more > room_) continue;
                held += more;
                wanted.push_back(l);
            }
        }
        measure(wanted);
    }
    if (node_label_.empty()) return;  // nobody has asked for candidates
    for (int l = 0; l < layer_count(); ++l) {
        if (holds(l) && !layers_[static_cast<std::size_t>(l)].has_candidates)
            find_layer_candidates(l);
    }
}

// Fills layers, one union of labels after another.
void LabelField::measure(const std::vector<int>& layers) {
    std::vector<char> wanted(layers_.size(), 0);
    for (const int l : layers) {
        Layer& layer = layers_[static_cast<std::size_t>(l)];
        wanted[static_cast<std::size_t>(l)] = 1;
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
    const auto in_layers = [&](std::uint32_t b) {
        return wanted[static_cast<std::size_t>(layer_of(b))] != 0;
    };
    std::vector<const Piece*> pieces;
    for (const Piece& piece : pieces_) {
        if (std::any_of(piece.blocks.begin(), piece.blocks.end(), in_layers))
            pieces.push_back(&piece);
    }
    const std::size_t label_count = this->label_count();
    const float beyond = static_cast<float>(distance_.limit_mm());
    // Each thread takes the next piece until all are taken, and keeps its scratch space.
    std::atomic<std::size_t> next{0};
    parallel_for(pieces.size(), 1, [&](std::size_t, std::size_t) {
        SparseBox phi;
        LabelDistance::Scratch scratch;
        std::vector<float> copied(step_mm_ > 0 ? phi_ : 0);
        NodeBlocks needed;
        needed.edge = block_edge();
        for (std::size_t p = next++; p < pieces.size(); p = next++) {
            const Piece& piece = *pieces[p];
            const bool own = piece.distance >= label_count;
            const auto l = static_cast<std::uint8_t>(piece.distance % label_count);
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
                Layer& layer = layers_[static_cast<std::size_t>(layer_of(b))];
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

}  // namespace sonocase::pipeline
