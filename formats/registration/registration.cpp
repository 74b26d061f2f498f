// SPDX-License-Identifier: Apache-2.0

#include "formats/registration/registration.h"

#include <algorithm>
#include <cmath>

namespace sonocase {
namespace {

// Values and derivatives of the four cubic B-splines that are not zero at fraction t of a cell.
struct SplineWeights {
    std::array<double, 4> value;
    std::array<double, 4> slope;
};

SplineWeights spline_weights(double t) {
    const double s = 1 - t;
    return {{s * s * s / 6, (3 * t * t * t - 6 * t * t + 4) / 6,
             (3 * s * s * s - 6 * s * s + 4) / 6, t * t * t / 6},
            {-s * s / 2, (3 * t * t - 4 * t) / 2, -(3 * s * s - 4 * s) / 2, t * t / 2}};
}

struct SplineCell {
    std::array<int, 3> first;
    std::array<SplineWeights, 3> weights;
    std::array<bool, 3> clamped;
};

SplineCell locate(const DisplacementGrid& grid, Point3 p) {
    SplineCell cell;
    for (int a = 0; a < 3; ++a) {
        const int cells = grid.size[a] - 3;
        const double u = (p[a] - grid.origin_mm[a]) / grid.spacing_mm;
        const double inside = std::clamp(u, 0.0, static_cast<double>(cells));
        const auto i = static_cast<std::size_t>(a);
        cell.clamped[i] = inside != u;
        cell.first[i] = std::min(static_cast<int>(inside), cells - 1);
        cell.weights[i] = spline_weights(inside - cell.first[i]);
    }
    return cell;
}

Vector3 combine(const DisplacementGrid& grid,
                const SplineCell& cell,
                const std::array<double, 4>& wx,
                const std::array<double, 4>& wy,
                const std::array<double, 4>& wz) {
    Vector3 sum;
    for (std::size_t c = 0; c < 4; ++c) {
        for (std::size_t b = 0; b < 4; ++b) {
            const std::size_t row = static_cast<std::size_t>(cell.first[0]) +
                                    static_cast<std::size_t>(grid.size.x) *
                                        ((static_cast<std::size_t>(cell.first[1]) + b) +
                                         static_cast<std::size_t>(grid.size.y) *
                                             (static_cast<std::size_t>(cell.first[2]) + c));
            Vector3 line;
            for (std::size_t a = 0; a < 4; ++a) line = line + wx[a] * grid.control_mm[row + a];
            sum = sum + (wy[b] * wz[c]) * line;
        }
    }
    return sum;
}

// Offset from the map's centre in its scale.
Vector3 scaled(const QuadraticMap& map, Point3 p) {
    return {(p.x - map.centre_mm.x) / map.scale_mm, (p.y - map.centre_mm.y) / map.scale_mm,
            (p.z - map.centre_mm.z) / map.scale_mm};
}

}  // namespace

QuadraticMap QuadraticMap::from_rigid(const Rigid& to_from, Point3 centre_mm, double scale_mm) {
    QuadraticMap map;
    map.centre_mm = centre_mm;
    map.scale_mm = scale_mm;
    const Point3 centre_to = to_from * centre_mm;
    for (int r = 0; r < 3; ++r) {
        auto& row = map.coefficients[static_cast<std::size_t>(r)];
        row[0] = centre_to[r];
        for (int c = 0; c < 3; ++c)
            row[static_cast<std::size_t>(1 + c)] = scale_mm * to_from.rotation(r, c);
    }
    return map;
}

Point3 map_point(const QuadraticMap& map, Point3 p) {
    const auto [u, v, w] = scaled(map, p);
    Point3 out;
    for (int r = 0; r < 3; ++r) {
        const auto& k = map.coefficients[static_cast<std::size_t>(r)];
        out[r] = k[0] + k[1] * u + k[2] * v + k[3] * w + k[4] * u * u + k[5] * v * v +
                 k[6] * w * w + k[7] * u * v + k[8] * u * w + k[9] * v * w;
    }
    return out;
}

Matrix3 jacobian(const QuadraticMap& map, Point3 p) {
    const auto [u, v, w] = scaled(map, p);
    Matrix3 j;
    for (int r = 0; r < 3; ++r) {
        const auto& k = map.coefficients[static_cast<std::size_t>(r)];
        j(r, 0) = (k[1] + 2 * k[4] * u + k[7] * v + k[8] * w) / map.scale_mm;
        j(r, 1) = (k[2] + 2 * k[5] * v + k[7] * u + k[9] * w) / map.scale_mm;
        j(r, 2) = (k[3] + 2 * k[6] * w + k[8] * u + k[9] * v) / map.scale_mm;
    }
    return j;
}

Vector3 displacement(const DisplacementGrid& grid, Point3 p) {
    if (grid.empty()) return {};
    const SplineCell cell = locate(grid, p);
    return combine(grid, cell, cell.weights[0].value, cell.weights[1].value, cell.weights[2].value);
}

Matrix3 displacement_jacobian(const DisplacementGrid& grid, Point3 p) {
    if (grid.empty()) return Matrix3::diagonal({0, 0, 0});
    const SplineCell cell = locate(grid, p);
    std::array<Vector3, 3> column;
    for (std::size_t axis = 0; axis < 3; ++axis) {
        if (cell.clamped[axis]) continue;  // constant beyond the box
        const auto& x = axis == 0 ? cell.weights[0].slope : cell.weights[0].value;
        const auto& y = axis == 1 ? cell.weights[1].slope : cell.weights[1].value;
        const auto& z = axis == 2 ? cell.weights[2].slope : cell.weights[2].value;
        column[axis] = combine(grid, cell, x, y, z) / grid.spacing_mm;
    }
    return Matrix3::from_columns(column[0], column[1], column[2]);
}

Point3 mannequin_from_ct(const Registration& registration, Point3 ct) {
    return map_point(registration.quadratic, ct) + displacement(registration.residual, ct);
}

Matrix3 jacobian(const Registration& registration, Point3 ct) {
    Matrix3 j = jacobian(registration.quadratic, ct);
    const Matrix3 d = displacement_jacobian(registration.residual, ct);
    for (std::size_t i = 0; i < 9; ++i) j.m[i] += d.m[i];
    return j;
}

}  // namespace sonocase
