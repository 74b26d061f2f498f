// SPDX-License-Identifier: Apache-2.0

#include "pipeline/registration/map/map_proofs.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <cstddef>
#include <limits>
#include <vector>

#include <Eigen/Dense>

#include "formats/base/constants.h"
#include "pipeline/base/parallel.h"
#include "pipeline/registration/map/registration.h"

namespace sonocase::pipeline::inline registration_map {

namespace {

// What both proofs share: the parts of the CT box in which the map is one polynomial, its Jacobian
// there, and Bernstein form.
//
// A polynomial of degree n in each axis is determined by (n + 1)^3 samples; in Bernstein form it is
// bounded by its smallest coefficient, because it is their convex combination everywhere.
constexpr int kMaxNodes = 9;

// From values at nodes in [0, 1] to Bernstein coefficients of the same polynomial.
struct BernsteinForm {
    explicit BernsteinForm(int degree);  // [1, kMaxNodes - 1]
    // In place, along all three axes of nodes^3 values, the first axis fastest.
    void coefficients_from_values(double* values) const;
    // Bound on the rounding error of a coefficient.
    double rounding(double largest_value) const;

    int nodes;
    double node[kMaxNodes] = {};
    double matrix[kMaxNodes][kMaxNodes] = {};
    double growth = 0;  // largest sum of magnitudes in a row
};

struct Piece {
    Int3 cell;  // of the spline; not used without one
    Box3 box;   // ct
};
// Values and slopes (per mm) of the four splines of a cell at fraction t.
void spline_basis(double t, double spacing_mm, double value[4], double slope[4]) {
    const double s = 1 - t;
    value[0] = s * s * s / 6;
    value[1] = (3 * t * t * t - 6 * t * t + 4) / 6;
    value[2] = (3 * s * s * s - 6 * s * s + 4) / 6;
    value[3] = t * t * t / 6;
    slope[0] = -s * s / (2 * spacing_mm);
    slope[1] = (3 * t * t - 4 * t) / (2 * spacing_mm);
    slope[2] = -(3 * s * s - 4 * s) / (2 * spacing_mm);
    slope[3] = t * t / (2 * spacing_mm);
}

BernsteinForm::BernsteinForm(int degree) : nodes(degree + 1) {
    Eigen::MatrixXd values(nodes, nodes);
    for (int i = 0; i < nodes; ++i) {
        // Chebyshev nodes stretched to the ends: well conditioned, and corners are sampled.
        node[i] = 0.5 - 0.5 * std::cos(kPi * i / degree);
        double choose = 1;
        for (int j = 0; j <= degree; ++j) {
            values(i, j) = choose * std::pow(node[i], j) * std::pow(1 - node[i], degree - j);
            choose = choose * (degree - j) / (j + 1);
        }
    }
    const Eigen::MatrixXd back = values.fullPivLu().inverse();
    for (int i = 0; i < nodes; ++i) {
        double row = 0;
        for (int j = 0; j < nodes; ++j) {
            matrix[i][j] = back(i, j);
            row += std::abs(back(i, j));
        }
        growth = std::max(growth, row);
    }
}

void BernsteinForm::coefficients_from_values(double* values) const {
    const int n = nodes;
    const auto along = [&](int stride, int a, int b) {
        double line[kMaxNodes];
        double* at = values + a + b;
        for (int i = 0; i < n; ++i) line[i] = at[i * stride];
        for (int i = 0; i < n; ++i) {
            double sum = 0;
            for (int j = 0; j < n; ++j) sum += matrix[i][j] * line[j];
            at[i * stride] = sum;
        }
    };
    for (int b = 0; b < n; ++b) {
        for (int a = 0; a < n; ++a) along(1, a * n, b * n * n);
    }
    for (int b = 0; b < n; ++b) {
        for (int a = 0; a < n; ++a) along(n, a, b * n * n);
    }
    for (int b = 0; b < n; ++b) {
        for (int a = 0; a < n; ++a) along(n * n, a, b * n);
    }
}

double BernsteinForm::rounding(double largest_value) const {
    return 64 * std::numeric_limits<double>::epsilon() * largest_value * growth * growth * growth;
}

std::vector<Piece> pieces_of(const Registration& r) {
    const DisplacementGrid& grid = r.residual;
    if (grid.empty()) return {{{0, 0, 0}, r.ct_box}};
    std::vector<Piece> pieces;
    const Int3 cells{grid.size.x - 3, grid.size.y - 3, grid.size.z - 3};
    for (int k = 0; k < cells.z; ++k) {
        for (int j = 0; j < cells.y; ++j) {
            for (int i = 0; i < cells.x; ++i) {
                Piece piece{{i, j, k}, {}};
                bool empty = false;
                for (int a = 0; a < 3; ++a) {
                    const int c = piece.cell[a];
                    const double low = grid.origin_mm[a] + c * grid.spacing_mm;
                    piece.box.lower[a] = std::max(low, r.ct_box.lower[a]);
                    piece.box.upper[a] = std::min(low + grid.spacing_mm, r.ct_box.upper[a]);
                    empty = empty || piece.box.lower[a] > piece.box.upper[a];
                }
                if (!empty) pieces.push_back(piece);
            }
        }
    }
    return pieces;
}

// The piece cut into eight.
void append_eighths(const Piece& piece, std::vector<Piece>& parts) {
    const Point3 middle = piece.box.centre();
    for (int corner = 0; corner < 8; ++corner) {
        Piece part = piece;
        for (int a = 0; a < 3; ++a) {
            ((corner >> a & 1) ? part.box.lower : part.box.upper)[a] = middle[a];
        }
        parts.push_back(part);
    }
}

// Whether the residual's grid covers the box. Beyond the grid the displacement is constant across
// the faces, and the map is not one polynomial per cell.
bool covers(const DisplacementGrid& grid, const Box3& box) {
    if (grid.empty()) return true;
    for (int a = 0; a < 3; ++a) {
        const double low = grid.origin_mm[a], high = low + (grid.size[a] - 3) * grid.spacing_mm;
        const double slack = 1e-9 * (std::abs(low) + std::abs(high) + 1);
        if (low > box.lower[a] + slack || high < box.upper[a] - slack) return false;
    }
    return true;
}

// At the nodes of the form over the piece, the first axis fastest. # nodes^3.
std::vector<Matrix3> jacobians_at_nodes(const Registration& r,
                                        const BernsteinForm& form,
                                        const Piece& piece) {
    const int n = form.nodes;
    std::vector<Matrix3> matrix(static_cast<std::size_t>(n) * n * n);
    double at[3][kMaxNodes];
    for (int a = 0; a < 3; ++a) {
        for (int i = 0; i < n; ++i) {
            const double t = form.node[i];
            at[a][i] = (1 - t) * piece.box.lower[a] + t * piece.box.upper[a];
        }
    }
    const DisplacementGrid& grid = r.residual;
    if (grid.empty()) {
        std::size_t m = 0;
        for (int k = 0; k < n; ++k) {
            for (int j = 0; j < n; ++j) {
                for (int i = 0; i < n; ++i, ++m) {
                    matrix[m] = jacobian(r.quadratic, {at[0][i], at[1][j], at[2][k]});
                }
            }
        }
        return matrix;
    }
    double value[3][kMaxNodes][4], slope[3][kMaxNodes][4];
    for (int a = 0; a < 3; ++a) {
        for (int i = 0; i < n; ++i) {
            const double t = (at[a][i] - grid.origin_mm[a]) / grid.spacing_mm - piece.cell[a];
            spline_basis(t, grid.spacing_mm, value[a][i], slope[a][i]);
        }
    }
    // Contract along z and y, then along x: planes, lines, points.
    const std::size_t row = static_cast<std::size_t>(grid.size.x);
    const std::size_t slice = row * static_cast<std::size_t>(grid.size.y);
    const Vector3* first = grid.control_mm.data() + static_cast<std::size_t>(piece.cell.x) +
                           row * static_cast<std::size_t>(piece.cell.y) +
                           slice * static_cast<std::size_t>(piece.cell.z);
    for (int k = 0; k < n; ++k) {
        Vector3 plane[4][4], plane_z[4][4];
        for (std::size_t b = 0; b < 4; ++b) {
            for (std::size_t a = 0; a < 4; ++a) {
                Vector3 v, s;
                for (std::size_t c = 0; c < 4; ++c) {
                    const Vector3 p = first[a + row * b + slice * c];
                    v = v + value[2][k][c] * p;
                    s = s + slope[2][k][c] * p;
                }
                plane[b][a] = v;
                plane_z[b][a] = s;
            }
        }
        for (int j = 0; j < n; ++j) {
            Vector3 line[4], line_y[4], line_z[4];
            for (std::size_t a = 0; a < 4; ++a) {
                for (std::size_t b = 0; b < 4; ++b) {
                    line[a] = line[a] + value[1][j][b] * plane[b][a];
                    line_y[a] = line_y[a] + slope[1][j][b] * plane[b][a];
                    line_z[a] = line_z[a] + value[1][j][b] * plane_z[b][a];
                }
            }
            for (int i = 0; i < n; ++i) {
                Matrix3 m = jacobian(r.quadratic, {at[0][i], at[1][j], at[2][k]});
                Vector3 dx, dy, dz;
                for (std::size_t a = 0; a < 4; ++a) {
                    dx = dx + slope[0][i][a] * line[a];
                    dy = dy + value[0][i][a] * line_y[a];
                    dz = dz + value[0][i][a] * line_z[a];
                }
                for (int row_of = 0; row_of < 3; ++row_of) {
                    m(row_of, 0) += dx[row_of];
                    m(row_of, 1) += dy[row_of];
                    m(row_of, 2) += dz[row_of];
                }
                matrix[i + n * (j + n * k)] = m;
            }
        }
    }
    return matrix;
}

constexpr int kDeepestCut = 4;
constexpr double kLoose = 0.01;  // a bound closer than this to the smallest sample is not refined

FoldProof bound_piece(const Registration& r, const BernsteinForm& form, const Piece& piece) {
    std::vector<double> det;
    for (const Matrix3& j : jacobians_at_nodes(r, form, piece)) det.push_back(determinant(j));
    FoldProof proof;
    double largest = 0;
    proof.min_sample = det[0];
    for (double d : det) {
        proof.min_sample = std::min(proof.min_sample, d);
        largest = std::max(largest, std::abs(d));
    }
    form.coefficients_from_values(det.data());
    const double lowest = *std::min_element(det.begin(), det.end());
    proof.min_bound = std::isfinite(lowest) ? lowest - form.rounding(largest)
                                            : -std::numeric_limits<double>::infinity();
    return proof;
}

}  // namespace

FoldProof prove_no_fold(const Registration& registration) {
    assert(!registration.ct_box.empty());
    FoldProof whole;
    whole.min_bound = whole.min_sample = -std::numeric_limits<double>::infinity();
    if (!covers(registration.residual, registration.ct_box)) return whole;
    const BernsteinForm form(registration.residual.empty() ? 3 : 8);
    std::vector<Piece> pieces = pieces_of(registration);
    whole.min_bound = whole.min_sample = std::numeric_limits<double>::infinity();
    for (int depth = 0; !pieces.empty(); ++depth) {
        std::vector<FoldProof> proofs(pieces.size());
        parallel_for(pieces.size(), 8, [&](std::size_t begin, std::size_t end) {
            for (std::size_t i = begin; i < end; ++i)
                proofs[i] = bound_piece(registration, form, pieces[i]);
        });
        for (const FoldProof& p : proofs) {
            whole.min_sample = std::min(whole.min_sample, p.min_sample);
        }
        std::vector<Piece> loose;
        for (std::size_t i = 0; i < pieces.size(); ++i) {
            if (depth == kDeepestCut || !(proofs[i].min_bound < whole.min_sample - kLoose)) {
                whole.min_bound = std::min(whole.min_bound, proofs[i].min_bound);
                continue;
            }
            append_eighths(pieces[i], loose);
        }
        pieces = std::move(loose);
    }
    return whole;
}

namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

using Minors = std::array<double, 3>;

// Entries 11, 22, 33, 12, 13, 23 of a symmetric matrix.
Minors minors_of(const double s[6]) {
    const double second = s[0] * s[1] - s[3] * s[3];
    return {s[0], second,
            s[2] * second - s[0] * s[5] * s[5] + 2 * s[3] * s[4] * s[5] - s[1] * s[4] * s[4]};
}

Minors smaller_of(const Minors& a, const Minors& b) {
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
        proof.sample = smaller_of(proof.sample, minors_of(s));
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
            positive ? smaller_of(proof.bound, m) : Minors{-kInfinity, -kInfinity, -kInfinity};
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

double OneToOneProof::min_minor() const {
    return *std::min_element(min_bound.begin(), min_bound.end());
}

OneToOneProof prove_one_to_one(const Registration& registration) {
    assert(!registration.ct_box.empty());
    OneToOneProof whole;
    whole.min_bound = whole.min_sample = {-kInfinity, -kInfinity, -kInfinity};
    if (!covers(registration.residual, registration.ct_box)) return whole;
    std::vector<Piece> pieces = pieces_of(registration);
    const Matrix3 mean = mean_jacobian(registration, pieces);
    if (!(determinant(mean) > 0)) return whole;
    const Matrix3 turned_back = transpose(nearest_rotation(mean));
    const BernsteinForm form(3);
    whole.min_bound = whole.min_sample = {kInfinity, kInfinity, kInfinity};
    for (int depth = 0; !pieces.empty(); ++depth) {
        std::vector<PieceProof> proofs(pieces.size());
        parallel_for(pieces.size(), 8, [&](std::size_t begin, std::size_t end) {
            for (std::size_t i = begin; i < end; ++i)
                proofs[i] = prove_piece(registration, turned_back, form, pieces[i]);
        });
        for (const PieceProof& p : proofs)
            whole.min_sample = smaller_of(whole.min_sample, p.sample);
        // Where a sample is not positive no cut can help.
        const bool refuted =
            *std::min_element(whole.min_sample.begin(), whole.min_sample.end()) <= 0;
        std::vector<Piece> loose;
        for (std::size_t i = 0; i < pieces.size(); ++i) {
            bool tight = true;
            for (std::size_t m = 0; m < 3; ++m)
                tight = tight && proofs[i].bound[m] >= whole.min_sample[m] - kLoose;
            if (tight || refuted || depth == kDeepestCut) {
                whole.min_bound = smaller_of(whole.min_bound, proofs[i].bound);
            } else {
                append_eighths(pieces[i], loose);
            }
        }
        pieces = std::move(loose);
    }
    // Without a bound the smallest sample says how far from one to one the map is.
    for (std::size_t m = 0; m < 3; ++m) {
        if (!std::isfinite(whole.min_bound[m]))
            whole.min_bound[m] = std::min(0.0, whole.min_sample[m]);
    }
    return whole;
}

}  // namespace sonocase::pipeline::inline registration_map
