// SPDX-License-Identifier: Apache-2.0

#include "pipeline/registration/map/map_pieces.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <limits>

namespace sonocase::pipeline {
namespace {

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

}  // namespace

BernsteinForm::BernsteinForm(int degree) : nodes(degree + 1) {
    Eigen::MatrixXd values(nodes, nodes);
    for (int i = 0; i < nodes; ++i) {
        // Chebyshev nodes stretched to the ends: well conditioned, and corners are sampled.
        node[i] = 0.5 - 0.5 * std::cos(3.14159265358979323846 * i / degree);
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
        double line[kMostNodes];
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

bool covers(const DisplacementGrid& grid, const Box3& box) {
    if (grid.empty()) return true;
    for (int a = 0; a < 3; ++a) {
        const double low = grid.origin_mm[a], high = low + (grid.size[a] - 3) * grid.spacing_mm;
        const double slack = 1e-9 * (std::abs(low) + std::abs(high) + 1);
        if (low > box.lower[a] + slack || high < box.upper[a] - slack) return false;
    }
    return true;
}

std::vector<Matrix3> jacobians_at_nodes(const Registration& r,
                                        const BernsteinForm& form,
                                        const Piece& piece) {
    const int n = form.nodes;
    std::vector<Matrix3> matrix(static_cast<std::size_t>(n) * static_cast<std::size_t>(n) *
                                static_cast<std::size_t>(n));
    double at[3][kMostNodes];
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
    double value[3][kMostNodes][4], slope[3][kMostNodes][4];
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
                matrix[static_cast<std::size_t>(i + n * (j + n * k))] = m;
            }
        }
    }
    return matrix;
}

}  // namespace sonocase::pipeline
