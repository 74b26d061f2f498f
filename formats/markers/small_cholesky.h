// SPDX-License-Identifier: Apache-2.0

// Normal equations of a handful of unknowns, solved by Cholesky's factor. No allocation.
#pragma once

#include <array>
#include <cmath>

namespace sonocase {

// Least squares of residuals r(x) about the present x: the step solves normal * step = right.
template <int kSize>
struct SymmetricSystem {
    std::array<double, kSize * kSize> normal{};  // the lower triangle, row by row
    std::array<double, kSize> right{};

    // One residual with its derivatives.
    void add(const double* row, double residual, double weight) {
        for (int a = 0; a < kSize; ++a) {
            const double scaled = weight * row[a];
            for (int b = 0; b <= a; ++b) normal[a * kSize + b] += scaled * row[b];
            right[a] -= scaled * residual;
        }
    }
    // Turns `normal` into its factor L, L L^T; false: it is not positive definite.
    bool factorise() {
        for (int j = 0; j < kSize; ++j) {
            for (int i = j; i < kSize; ++i) {
                double sum = normal[i * kSize + j];
                for (int k = 0; k < j; ++k) sum -= normal[i * kSize + k] * normal[j * kSize + k];
                if (i == j) {
                    if (!(sum > 0)) return false;
                    normal[i * kSize + i] = std::sqrt(sum);
                } else {
                    normal[i * kSize + j] = sum / normal[j * kSize + j];
                }
            }
        }
        return true;
    }
    // b becomes the solution; after factorise().
    void solve(std::array<double, kSize>& b) const {
        for (int i = 0; i < kSize; ++i) {
            for (int k = 0; k < i; ++k) b[i] -= normal[i * kSize + k] * b[k];
            b[i] /= normal[i * kSize + i];
        }
        for (int i = kSize - 1; i >= 0; --i) {
            for (int k = i + 1; k < kSize; ++k) b[i] -= normal[k * kSize + i] * b[k];
            b[i] /= normal[i * kSize + i];
        }
    }
};

}  // namespace sonocase
