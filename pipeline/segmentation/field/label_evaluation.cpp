// SPDX-License-Identifier: Apache-2.0

// Evaluation of a label field at a point: the inner loop of resampling.
#include <algorithm>
#include <cassert>
#include <type_traits>

#include "pipeline/segmentation/field/label_field.h"

namespace sonocase::pipeline {
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
    EightShort v;  // four of which are asked for: kBehind numbers follow the last of a layer
    __builtin_memcpy(&v, p, sizeof v);
    // Each number twice in four bytes, of which the upper one is kept with its sign.
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
    const auto& [wx, wy, wz] = position.weights;
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

}  // namespace sonocase::pipeline
