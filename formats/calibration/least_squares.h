// SPDX-License-Identifier: Apache-2.0

// Linear least squares with many equations in a few unknowns, row by row: min |A x - b|.
//
// Rows are folded into a triangular factor by Givens rotations, so that the condition number of A
// is not squared and nothing is allocated however many rows are added. solve() computes the
// singular values of that factor by one-sided Jacobi rotations: they show what the rows determine.
// Where they leave a direction undetermined, the solution of minimum length is returned. Cost:
// about 6 n^2 flops per row for n unknowns. Constant memory; may run in the frame loop.
#pragma once

#include <array>
#include <cstdint>

namespace sonocase {

inline constexpr int kMaxUnknowns = 8;

struct LeastSquaresFit {
    int unknowns = 0;
    int rank = 0;                                 // singular values above tolerance * largest
    std::array<double, kMaxUnknowns> x{};         // of minimum length if rank < unknowns
    std::array<double, kMaxUnknowns> singular{};  // in decreasing order
    // Right singular vectors: direction[k] belongs to singular[k]; unit length.
    std::array<std::array<double, kMaxUnknowns>, kMaxUnknowns> direction{};
    double residual_sum = 0;  // |A x - b|^2

    // Largest over smallest singular value; infinite if the smallest is zero.
    double condition() const;
    // Entry of (A^T A)^-1; infinite where an undetermined direction takes part.
    double covariance(int i, int j) const;
};

class LeastSquares {
  public:
    explicit LeastSquares(int unknowns);  // 1..kMaxUnknowns
    // One equation; `row` holds # unknowns coefficients. All finite.
    void add(const double* row, double value);
    // All equations of another system in the same unknowns.
    void add(const LeastSquares& other);
    std::int64_t rows() const { return rows_; }
    LeastSquaresFit solve(double rank_tolerance = 1e-12) const;

  private:
    int unknowns_;
    std::int64_t rows_ = 0;
    double residual_sum_ = 0;
    // Upper triangular factor with the right-hand side as last column.
    std::array<std::array<double, kMaxUnknowns + 1>, kMaxUnknowns> factor_{};
};

}  // namespace sonocase
