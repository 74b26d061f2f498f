// SPDX-License-Identifier: Apache-2.0

// Givens QR and one-sided Jacobi against long double and against exact rationals.
#include "formats/calibration/least_squares.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <vector>

#include "numerics/property.h"
#include "support/hard_case.h"

namespace sonocase::numerics {
namespace {

using testing::HardCase;

using Row = std::array<double, kMaxUnknowns>;

struct System {
    int unknowns = 3;
    std::vector<Row> rows;
    std::vector<double> right;
};

LeastSquaresFit solve(const System& s) {
    LeastSquares system(s.unknowns);
    for (std::size_t i = 0; i < s.rows.size(); ++i) system.add(s.rows[i].data(), s.right[i]);
    return system.solve();
}

// Modified Gram-Schmidt with a second pass, in long double.
std::array<long double, kMaxUnknowns> reference(const System& s) {
    const auto n = static_cast<std::size_t>(s.unknowns), m = s.rows.size();
    std::vector<std::vector<long double>> q(n, std::vector<long double>(m));
    std::array<std::array<long double, kMaxUnknowns>, kMaxUnknowns> r{};
    for (std::size_t c = 0; c < n; ++c) {
        for (std::size_t i = 0; i < m; ++i) q[c][i] = s.rows[i][c];
        for (int pass = 0; pass < 2; ++pass) {
            for (std::size_t b = 0; b < c; ++b) {
                long double along = 0;
                for (std::size_t i = 0; i < m; ++i) along += q[b][i] * q[c][i];
                r[b][c] += along;
                for (std::size_t i = 0; i < m; ++i) q[c][i] -= along * q[b][i];
            }
        }
        long double square = 0;
        for (long double v : q[c]) square += v * v;
        r[c][c] = std::sqrt(square);
        for (long double& v : q[c]) v /= r[c][c];
    }
    std::array<long double, kMaxUnknowns> x{};
    for (std::size_t k = n; k-- > 0;) {
        long double sum = 0;
        for (std::size_t i = 0; i < m; ++i) sum += q[k][i] * s.right[i];
        for (std::size_t j = k + 1; j < n; ++j) sum -= r[k][j] * x[j];
        x[k] = sum / r[k][k];
    }
    return x;
}

// Columns scaled so that the condition number is about 10^decades.
System random_system(testing::Random& random, int unknowns, double decades, double residual) {
    System s;
    s.unknowns = unknowns;
    Row truth{};
    for (int k = 0; k < unknowns; ++k) truth[k] = random.gaussian();
    const int rows = unknowns + static_cast<int>(random.uniform(1, 60));
    for (int i = 0; i < rows; ++i) {
        Row row{};
        double right = residual * random.gaussian();
        const double shared = random.gaussian();
        for (int k = 0; k < unknowns; ++k) {
            // Nearly dependent columns: ill-conditioned at any scale.
            const auto c = static_cast<std::size_t>(k);
            row[c] = shared + std::pow(10.0, -decades * (k > 0)) * random.gaussian();
            right += row[c] * truth[c];
        }
        s.rows.push_back(row);
        s.right.push_back(right);
    }
    return s;
}

// Error of a random system's answer over Wedin's bound: relative error
// <= eps (k + k^2 |r| / (|A| |x|)), times a modest function of the sizes.
double error_over_bound(testing::Random random) {
    const int unknowns = static_cast<int>(random.uniform(1, 8.999));
    const double decades = random.uniform(0, 6), residual = random.uniform(0, 1) < 0.5 ? 0 : 0.1;
    const System s = random_system(random, unknowns, decades, residual);
    const LeastSquaresFit fit = solve(s);
    const auto truth = reference(s);
    double x = 0, error = 0;
    for (int k = 0; k < unknowns; ++k) {
        const auto c = static_cast<std::size_t>(k);
        x = std::hypot(x, static_cast<double>(truth[c]));
        error = std::hypot(error, static_cast<double>(fit.x[c] - truth[c]));
    }
    const double k = fit.condition();
    const double bend = k * k * std::sqrt(fit.residual_sum) / (fit.singular[0] * x);
    const double sizes = 10.0 * static_cast<double>(s.rows.size()) * unknowns;
    return error / (sizes * kEpsilon * (k + bend) * x + 1e-300);
}

RC_GTEST_PROP(LeastSquaresNumerics, ErrorStaysWithinTheBoundOfTheCondition, ()) {
    RC_ASSERT(error_over_bound(random_case()) <= 1);
}

TEST(LeastSquaresNumerics, ErrorOfAThousandSystemsOverTheBoundOfTheCondition) {
    HardCase error("error over the bound, a thousand systems", HardCase::at_most, 1, "");
    for (std::uint64_t seed = 1; seed <= 1000; ++seed)
        error.see(error_over_bound(testing::Random(seed)));
}

// Over the bound; -1: the system is singular.
double integers_over_bound(testing::Random random) {
    System s;
    s.unknowns = 2;
    __int128 aa = 0, ab = 0, bb = 0, ay = 0, by = 0;
    for (int i = 0; i < 12; ++i) {
        const auto draw = [&] { return static_cast<std::int64_t>(random.uniform(-1000, 1000)); };
        const std::int64_t a = draw(), b = draw(), y = draw();
        s.rows.push_back({static_cast<double>(a), static_cast<double>(b)});
        s.right.push_back(static_cast<double>(y));
        aa += a * a, ab += a * b, bb += b * b, ay += a * y, by += b * y;
    }
    const __int128 det = aa * bb - ab * ab;
    if (det == 0) return -1;
    const auto ratio = [&](__int128 top) {
        return static_cast<double>(static_cast<long double>(top) / static_cast<long double>(det));
    };
    const LeastSquaresFit fit = solve(s);
    const double k = fit.condition();
    const double bound =
        100 * kEpsilon * (k + k * k * std::sqrt(fit.residual_sum) / fit.singular[0]);
    return std::max(std::abs(fit.x[0] - ratio(ay * bb - by * ab)),
                    std::abs(fit.x[1] - ratio(by * aa - ay * ab))) /
           bound;
}

RC_GTEST_PROP(LeastSquaresNumerics, IntegersAgreeWithExactRationals, ()) {
    const double off = integers_over_bound(random_case());
    RC_PRE(off >= 0);
    RC_ASSERT(off <= 1);
}

TEST(LeastSquaresNumerics, IntegersOfAThousandSystemsAgreeWithExactRationals) {
    HardCase off("off exact rationals, over the bound, a thousand systems", HardCase::at_most, 1,
                 "");
    for (std::uint64_t seed = 1; seed <= 1000; ++seed)
        off.see(integers_over_bound(testing::Random(seed)));
}

// Over the bound.
double other_order_over_bound(testing::Random random) {
    const System s = random_system(random, 4, 2, 0.1);
    const LeastSquaresFit fit = solve(s);
    System turned = s;
    std::reverse(turned.rows.begin(), turned.rows.end());
    std::reverse(turned.right.begin(), turned.right.end());
    LeastSquares first(4), second(4);
    for (std::size_t i = 0; i < s.rows.size(); ++i)
        (i % 2 ? first : second).add(s.rows[i].data(), s.right[i]);
    first.add(second);
    if (first.rows() != static_cast<std::int64_t>(s.rows.size())) return INFINITY;
    const LeastSquaresFit other = solve(turned), merged = first.solve();
    const double k = fit.condition();
    const double bound =
        1e3 * kEpsilon * (k + k * k * std::sqrt(fit.residual_sum) / fit.singular[0]) * 10;
    double worst = 0;
    for (std::size_t c = 0; c < 4; ++c) {
        worst = std::max(worst, std::abs(other.x[c] - fit.x[c]) / bound);
        worst = std::max(worst, std::abs(merged.x[c] - fit.x[c]) / bound);
    }
    return std::max(
        worst, std::abs(merged.residual_sum - fit.residual_sum) / (1e-10 * (1 + fit.residual_sum)));
}

RC_GTEST_PROP(LeastSquaresNumerics, OrderOfRowsAndSplittingDoNotMatter, ()) {
    RC_ASSERT(other_order_over_bound(random_case()) <= 1);
}

TEST(LeastSquaresNumerics, OrderOfRowsOfAThousandSystemsDoesNotMatter) {
    HardCase off("rows in another order or in two heaps, off, over the bound, a thousand systems",
                 HardCase::at_most, 1, "");
    for (std::uint64_t seed = 1; seed <= 1000; ++seed)
        off.see(other_order_over_bound(testing::Random(seed)));
}

RC_GTEST_PROP(LeastSquaresNumerics, PowersOfTwoScaleExactly, ()) {
    testing::Random random = random_case();
    const System s = random_system(random, 3, 1, 0.1);
    System scaled = s;
    const double f = std::ldexp(1.0, static_cast<int>(random.uniform(-200, 200)));
    for (Row& row : scaled.rows) {
        for (double& v : row) v *= f;
    }
    for (double& v : scaled.right) v *= f;
    const LeastSquaresFit a = solve(s), b = solve(scaled);
    for (std::size_t c = 0; c < 3; ++c) {
        RC_ASSERT(std::abs(a.x[c] - b.x[c]) <= 1e-12 * (1 + std::abs(a.x[c])));
        RC_ASSERT(std::abs(b.singular[c] / f - a.singular[c]) <= 1e-12 * a.singular[c]);
    }
}

RC_GTEST_PROP(LeastSquaresNumerics, CovarianceIsTheInverseOfTheNormalMatrix, ()) {
    testing::Random random = random_case();
    const System s = random_system(random, 3, 1, 0);
    const LeastSquaresFit fit = solve(s);
    long double a[3][3] = {};
    for (const Row& row : s.rows) {
        for (std::size_t i = 0; i < 3; ++i) {
            for (std::size_t j = 0; j < 3; ++j)
                a[i][j] += static_cast<long double>(row[i]) * row[j];
        }
    }
    const double k = fit.condition();
    for (int i = 0; i < 3; ++i) {
        for (int j = 0; j < 3; ++j) {
            long double product = 0;
            for (int m = 0; m < 3; ++m) product += a[i][m] * fit.covariance(m, j);
            RC_ASSERT(std::abs(static_cast<double>(product) - (i == j)) <= 1e3 * kEpsilon * k * k);
        }
    }
}

TEST(LeastSquaresNumerics, OpenDirectionsAreFoundAndTheAnswerIsTheShortest) {
    LeastSquares system(3);
    const double row[3] = {1, 1, 0}, other[3] = {0, 0, 2};
    for (int i = 0; i < 5; ++i) {
        system.add(row, 2);
        system.add(other, 4);
    }
    const LeastSquaresFit fit = system.solve();
    EXPECT_EQ(fit.rank, 2);
    HardCase off("shortest answer, off", HardCase::at_most, 4 * kEpsilon, "");
    for (int c = 0; c < 3; ++c)
        off.see(std::abs(fit.x[static_cast<std::size_t>(c)] - (c < 2 ? 1 : 2)));
    EXPECT_NEAR(std::abs(fit.direction[2][0]), std::sqrt(0.5), 1e-15);
    EXPECT_TRUE(std::isinf(fit.covariance(0, 0)));
    EXPECT_FALSE(std::isinf(fit.covariance(2, 2)));
    EXPECT_GT(fit.condition(), 1e15);
}

TEST(LeastSquaresNumerics, NothingZeroAndOneRow) {
    HardCase off("answers of a zero row and of one row, off", HardCase::at_most, 0, "");
    EXPECT_EQ(LeastSquares(3).solve().rank, 0);
    LeastSquares zero(2);
    const double none[2] = {0, 0};
    zero.add(none, 5);
    EXPECT_EQ(zero.solve().rank, 0);
    EXPECT_EQ(zero.solve().residual_sum, 25);
    for (const double x : zero.solve().x) off.see(std::abs(x));
    LeastSquares one(1);
    const double two = 2;
    one.add(&two, 6);
    off.see(std::abs(one.solve().x[0] - 3));
    EXPECT_EQ(one.solve().condition(), 1);
}

TEST(LeastSquaresNumerics, TinyAndHugeRowsNeitherUnderNorOverflow) {
    HardCase off("answer of rows of 1e-140 and 1e140, off", HardCase::at_most, 8 * kEpsilon, "");
    for (double f : {1e-140, 1e140}) {
        LeastSquares system(2);
        const double a[2] = {f, 0}, b[2] = {f, f};
        system.add(a, f);
        system.add(b, 3 * f);
        const LeastSquaresFit fit = system.solve();
        off.see(std::abs(fit.x[0] - 1));
        off.see(std::abs(fit.x[1] - 2));
    }
}

}  // namespace
}  // namespace sonocase::numerics
