// SPDX-License-Identifier: Apache-2.0

#include "formats/calibration/least_squares.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <limits>
#include <utility>

namespace sonocase {

double LeastSquaresFit::condition() const {
    const double smallest = singular[unknowns - 1];
    return smallest > 0 ? singular[0] / smallest : std::numeric_limits<double>::infinity();
}

double LeastSquaresFit::covariance(int i, int j) const {
    double sum = 0;
    for (int k = 0; k < unknowns; ++k) {
        const auto& v = direction[k];
        const double part = v[i] * v[j];
        const double s = singular[k];
        if (k >= rank) {
            // Rounding leaves traces of the undetermined direction in every unknown: ignore them.
            if (std::abs(part) > 1e-12) return std::copysign(INFINITY, part);
            continue;
        }
        sum += part / (s * s);
    }
    return sum;
}

LeastSquares::LeastSquares(int unknowns) : unknowns_(unknowns) {
    assert(unknowns >= 1 && unknowns <= kMaxUnknowns);
}

void LeastSquares::add(const double* row, double value) {
    std::array<double, kMaxUnknowns + 1> a{};
    const auto n = static_cast<std::size_t>(unknowns_);
    for (std::size_t k = 0; k < n; ++k) a[k] = row[k];
    a[n] = value;
    for (std::size_t k = 0; k < n; ++k) {
        if (a[k] == 0) continue;
        auto& r = factor_[k];
        const double length = std::hypot(r[k], a[k]);
        const double c = r[k] / length, s = a[k] / length;
        for (std::size_t j = k; j <= n; ++j) {
            const double top = r[j], low = a[j];
            r[j] = c * top + s * low;
            a[j] = c * low - s * top;
        }
        a[k] = 0;
    }
    residual_sum_ += a[n] * a[n];
    ++rows_;
}

void LeastSquares::add(const LeastSquares& other) {
    assert(other.unknowns_ == unknowns_);
    const std::int64_t rows = rows_ + other.rows_;
    for (int k = 0; k < unknowns_; ++k) {
        const auto& row = other.factor_[k];
        add(row.data(), row[unknowns_]);
    }
    residual_sum_ += other.residual_sum_;
    rows_ = rows;
}

LeastSquaresFit LeastSquares::solve(double rank_tolerance) const {
    const auto n = static_cast<std::size_t>(unknowns_);
    // Columns of the factor in w, of V in v; rotate pairs until all columns of w are orthogonal.
    std::array<std::array<double, kMaxUnknowns>, kMaxUnknowns> w{}, v{};
    for (std::size_t c = 0; c < n; ++c) {
        for (std::size_t r = 0; r <= c; ++r) w[c][r] = factor_[r][c];
        v[c][c] = 1;
    }
    const auto dot = [n](const auto& a, const auto& b) {
        double sum = 0;
        for (std::size_t k = 0; k < n; ++k) sum += a[k] * b[k];
        return sum;
    };
    constexpr int kMaxSweeps = 40;
    for (int sweep = 0; sweep < kMaxSweeps; ++sweep) {
        bool rotated = false;
        for (std::size_t p = 0; p + 1 < n; ++p) {
            for (std::size_t q = p + 1; q < n; ++q) {
                const double pp = dot(w[p], w[p]), qq = dot(w[q], w[q]), pq = dot(w[p], w[q]);
                if (!(std::abs(pq) > 1e-16 * std::sqrt(pp) * std::sqrt(qq))) continue;
                const double zeta = (qq - pp) / (2 * pq);
                const double t = std::copysign(1 / (std::abs(zeta) + std::hypot(1.0, zeta)), zeta);
                const double c = 1 / std::hypot(1.0, t), s = c * t;
                if (c == 1 && std::abs(t) < 1e-300) continue;
                rotated = true;
                for (std::size_t k = 0; k < n; ++k) {
                    const double wp = w[p][k], wq = w[q][k], vp = v[p][k], vq = v[q][k];
                    w[p][k] = c * wp - s * wq;
                    w[q][k] = s * wp + c * wq;
                    v[p][k] = c * vp - s * vq;
                    v[q][k] = s * vp + c * vq;
                }
            }
        }
        if (!rotated) break;
    }

    std::array<std::size_t, kMaxUnknowns> order{};
    std::array<double, kMaxUnknowns> length{};
    for (std::size_t c = 0; c < n; ++c) {
        order[c] = c;
        length[c] = std::sqrt(dot(w[c], w[c]));
    }
    std::stable_sort(order.begin(), order.begin() + unknowns_,
                     [&](std::size_t a, std::size_t b) { return length[a] > length[b]; });

    LeastSquaresFit fit;
    fit.unknowns = unknowns_;
    fit.residual_sum = residual_sum_;
    const double threshold = rank_tolerance * length[order[0]];
    for (std::size_t k = 0; k < n; ++k) {
        const std::size_t c = order[k];
        const double s = length[c];
        fit.singular[k] = s;
        fit.direction[k] = v[c];
        double along = 0;  // u_k . b
        if (s > 0) {
            for (std::size_t r = 0; r < n; ++r) along += w[c][r] / s * factor_[r][n];
        }
        if (s > threshold) {
            fit.rank = static_cast<int>(k) + 1;
            for (std::size_t j = 0; j < n; ++j) fit.x[j] += v[c][j] * (along / s);
        }
    }
    // The part of b outside the span of the determined directions is residual as well.
    std::array<double, kMaxUnknowns> left{};
    for (std::size_t r = 0; r < n; ++r) {
        left[r] = factor_[r][n];
        for (std::size_t j = r; j < n; ++j) left[r] -= factor_[r][j] * fit.x[j];
        fit.residual_sum += left[r] * left[r];
    }
    return fit;
}

}  // namespace sonocase
