// SPDX-License-Identifier: Apache-2.0

#include "pipeline/registration/map/fold_proof.h"

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
constexpr double kLoose = 0.01;  // a bound closer than this to the least sample is not refined

FoldProof prove_piece(const Registration& r, const BernsteinForm& form, const Piece& piece) {
    std::vector<double> det;
    for (const Matrix3& j : jacobians_at_nodes(r, form, piece)) det.push_back(determinant(j));
    FoldProof proof;
    double largest = 0;
    proof.least_sample = det[0];
    for (double d : det) {
        proof.least_sample = std::min(proof.least_sample, d);
        largest = std::max(largest, std::abs(d));
    }
    form.coefficients_from_values(det.data());
    const double least = *std::min_element(det.begin(), det.end());
    proof.least_bound = std::isfinite(least) ? least - form.rounding(largest)
                                             : -std::numeric_limits<double>::infinity();
    return proof;
}

}  // namespace

FoldProof prove_no_fold(const Registration& registration) {
    assert(!registration.ct_box.empty());
    FoldProof whole;
    whole.least_bound = whole.least_sample = -std::numeric_limits<double>::infinity();
    if (!covers(registration.residual, registration.ct_box)) return whole;
    const BernsteinForm form(registration.residual.empty() ? 3 : 8);
    std::vector<Piece> pieces = pieces_of(registration);
    whole.least_bound = whole.least_sample = std::numeric_limits<double>::infinity();
    for (int depth = 0; !pieces.empty(); ++depth) {
        std::vector<FoldProof> proofs(pieces.size());
        parallel_for(pieces.size(), 8, [&](std::size_t begin, std::size_t end) {
            for (std::size_t i = begin; i < end; ++i)
                proofs[i] = prove_piece(registration, form, pieces[i]);
        });
        for (const FoldProof& p : proofs) {
            whole.least_sample = std::min(whole.least_sample, p.least_sample);
        }
        std::vector<Piece> loose;
        for (std::size_t i = 0; i < pieces.size(); ++i) {
            if (depth == kDeepestCut || !(proofs[i].least_bound < whole.least_sample - kLoose)) {
                whole.least_bound = std::min(whole.least_bound, proofs[i].least_bound);
                continue;
            }
            append_eighths(pieces[i], loose);
        }
        pieces = std::move(loose);
    }
    return whole;
}

}  // namespace sonocase::pipeline
