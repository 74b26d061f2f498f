// SPDX-License-Identifier: Apache-2.0

#include "pipeline/registration/map/one_to_one_proof.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <limits>
#include <vector>

#include "pipeline/base/parallel.h"
#include "pipeline/registration/map/map_pieces.h"

namespace sonocase::pipeline {
namespace {

constexpr int kDeepestCut = 4;
constexpr double kLoose = 0.01;
constexpr double kInfinity = std::numeric_limits<double>::infinity();

using Minors = std::array<double, 3>;

// Entries 11, 22, 33, 12, 13, 23 of a symmetric matrix.
Minors minors_of(const double s[6]) {
    const double second = s[0] * s[1] - s[3] * s[3];
    return {s[0], second,
            s[2] * second - s[0] * s[5] * s[5] + 2 * s[3] * s[4] * s[5] - s[1] * s[4] * s[4]};
}

Minors least_of(const Minors& a, const Minors& b) {
    return {std::min(a[0], b[0]), std::min(a[1], b[1]), std::min(a[2], b[2])};
}

struct PieceProof {
    Minors bound{kInfinity, kInfinity, kInfinity}, sample{kInfinity, kInfinity, kInfinity};
};

PieceProof prove_piece(const Registration& r,
                       const Matrix3& turned_back,
                       const BernsteinForm& form,
                       const Piece& piece) {
    const std::vector<Matrix3> jacobians = jacobians_at_nodes(r, form, piece);
    std::vector<double> entry[6];
    double largest = 0;
    PieceProof proof;
    for (const Matrix3& j : jacobians) {
        const Matrix3 a = turned_back * j;
        const double s[6] = {a(0, 0),
                             a(1, 1),
                             a(2, 2),
                             0.5 * (a(0, 1) + a(1, 0)),
                             0.5 * (a(0, 2) + a(2, 0)),
                             0.5 * (a(1, 2) + a(2, 1))};
        proof.sample = least_of(proof.sample, minors_of(s));
        for (int e = 0; e < 6; ++e) {
            entry[e].push_back(s[e]);
            largest = std::max(largest, std::abs(s[e]));
        }
    }
    for (std::vector<double>& values : entry) form.coefficients_from_values(values.data());
    // An error of `rounding` in each entry changes an eigenvalue by at most three times that.
    const double rounding = 3 * form.rounding(largest);
    for (std::size_t n = 0; n < jacobians.size(); ++n) {
        const double s[6] = {entry[0][n] - rounding,
                             entry[1][n] - rounding,
                             entry[2][n] - rounding,
                             entry[3][n],
                             entry[4][n],
                             entry[5][n]};
        const Minors m = minors_of(s);
        const bool positive = m[0] > 0 && m[1] > 0 && m[2] > 0;
        proof.bound =
            positive ? least_of(proof.bound, m) : Minors{-kInfinity, -kInfinity, -kInfinity};
        if (!positive) break;
    }
    return proof;
}

Matrix3 mean_jacobian(const Registration& r, const std::vector<Piece>& pieces) {
    Matrix3 mean = Matrix3::diagonal({0, 0, 0});
    for (const Piece& piece : pieces) {
        const Matrix3 j = jacobian(r, piece.box.centre());
        for (std::size_t n = 0; n < 9; ++n)
            mean.m[n] += j.m[n] / static_cast<double>(pieces.size());
    }
    return mean;
}

}  // namespace

double OneToOneProof::least_minor() const {
    return *std::min_element(least_bound.begin(), least_bound.end());
}

OneToOneProof prove_one_to_one(const Registration& registration) {
    assert(!registration.ct_box.empty());
    OneToOneProof whole;
    whole.least_bound = whole.least_sample = {-kInfinity, -kInfinity, -kInfinity};
    if (!covers(registration.residual, registration.ct_box)) return whole;
    std::vector<Piece> pieces = pieces_of(registration);
    const Matrix3 mean = mean_jacobian(registration, pieces);
    if (!(determinant(mean) > 0)) return whole;
    const Matrix3 turned_back = transpose(nearest_rotation(mean));
    const BernsteinForm form(3);
    whole.least_bound = whole.least_sample = {kInfinity, kInfinity, kInfinity};
    for (int depth = 0; !pieces.empty(); ++depth) {
        std::vector<PieceProof> proofs(pieces.size());
        parallel_for(pieces.size(), 8, [&](std::size_t begin, std::size_t end) {
            for (std::size_t i = begin; i < end; ++i)
                proofs[i] = prove_piece(registration, turned_back, form, pieces[i]);
        });
        for (const PieceProof& p : proofs)
            whole.least_sample = least_of(whole.least_sample, p.sample);
        // Where a sample is not positive no cut can help.
        const bool refuted =
            *std::min_element(whole.least_sample.begin(), whole.least_sample.end()) <= 0;
        std::vector<Piece> loose;
        for (std::size_t i = 0; i < pieces.size(); ++i) {
            bool tight = true;
            for (std::size_t m = 0; m < 3; ++m)
                tight = tight && proofs[i].bound[m] >= whole.least_sample[m] - kLoose;
            if (tight || refuted || depth == kDeepestCut) {
                whole.least_bound = least_of(whole.least_bound, proofs[i].bound);
            } else {
                append_eighths(pieces[i], loose);
            }
        }
        pieces = std::move(loose);
    }
    // Without a bound the least sample says how far from one to one the map is.
    for (std::size_t m = 0; m < 3; ++m) {
        if (!std::isfinite(whole.least_bound[m]))
            whole.least_bound[m] = std::min(0.0, whole.least_sample[m]);
    }
    return whole;
}

}  // namespace sonocase::pipeline
