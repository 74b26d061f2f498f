// SPDX-License-Identifier: Apache-2.0

#include "pipeline/registration/map/map_evaluator.h"

#include <algorithm>

namespace sonocase::pipeline::inline registration_map {

MapEvaluator::MapEvaluator(const Registration& registration) {
    const QuadraticMap& q = registration.quadratic;
    ct_centre_ = q.centre_mm;
    mannequin_centre_ = {q.coefficients[0][0], q.coefficients[1][0], q.coefficients[2][0]};
    scale_ = q.scale_mm;
    for (std::size_t r = 0; r < 3; ++r) {
        for (std::size_t c = 0; c < 10; ++c) coefficients_[r][c] = q.coefficients[r][c];
        coefficients_[r][0] = 0;
    }
    const DisplacementGrid& grid = registration.residual;
    if (grid.empty()) return;
    size_ = grid.size;
    origin_ = grid.origin_mm - ct_centre_;
    spacing_ = grid.spacing_mm;
    control_.reserve(grid.control_mm.size());
    for (const Vector3& c : grid.control_mm) {
        control_.push_back(
            Lanes{static_cast<float>(c.x), static_cast<float>(c.y), static_cast<float>(c.z), 0.0f});
    }
}

MapSample MapEvaluator::operator()(Vector3 ct) const {
    const double u = ct.x / scale_, v = ct.y / scale_, w = ct.z / scale_;
    const double inv = 1 / scale_;
    MapSample s;
    for (int r = 0; r < 3; ++r) {
        const double* k = coefficients_[r];
        s.value[r] = k[1] * u + k[2] * v + k[3] * w + k[4] * u * u + k[5] * v * v + k[6] * w * w +
                     k[7] * u * v + k[8] * u * w + k[9] * v * w;
        s.jacobian(r, 0) = (k[1] + 2 * k[4] * u + k[7] * v + k[8] * w) * inv;
        s.jacobian(r, 1) = (k[2] + 2 * k[5] * v + k[7] * u + k[9] * w) * inv;
        s.jacobian(r, 2) = (k[3] + 2 * k[6] * w + k[8] * u + k[9] * v) * inv;
    }
    if (!control_.empty()) add_residual(ct, &s);
    return s;
}

void MapEvaluator::add_residual(Vector3 ct, MapSample* sample) const {
    int first[3];
    float value[3][4], slope[3][4];
    for (int a = 0; a < 3; ++a) {
        const int cells = size_[a] - 3;
        const double at = (ct[a] - origin_[a]) / spacing_;
        const double inside = std::clamp(at, 0.0, static_cast<double>(cells));
        first[a] = std::min(static_cast<int>(inside), cells - 1);
        const float t = static_cast<float>(inside - first[a]), s = 1 - t;
        // Beyond its box the displacement is constant across the face.
        const float rate = inside == at ? static_cast<float>(1 / spacing_) : 0.0f;
        const float sixth = 1.0f / 6;
        value[a][0] = s * s * s * sixth;
        value[a][1] = (3 * t * t * t - 6 * t * t + 4) * sixth;
        value[a][2] = (3 * s * s * s - 6 * s * s + 4) * sixth;
        value[a][3] = t * t * t * sixth;
        slope[a][0] = -0.5f * s * s * rate;
        slope[a][1] = 0.5f * (3 * t * t - 4 * t) * rate;
        slope[a][2] = -0.5f * (3 * s * s - 4 * s) * rate;
        slope[a][3] = 0.5f * t * t * rate;
    }
    const Lanes zero = {0, 0, 0, 0};
    Lanes d = zero, dx = zero, dy = zero, dz = zero;
    const std::size_t row = static_cast<std::size_t>(size_.x);
    const std::size_t slice = row * static_cast<std::size_t>(size_.y);
    for (int c = 0; c < 4; ++c) {
        Lanes plane = zero, plane_dx = zero, plane_dy = zero;
        for (int b = 0; b < 4; ++b) {
            const Lanes* p = control_.data() + static_cast<std::size_t>(first[0]) +
                             row * static_cast<std::size_t>(first[1] + b) +
                             slice * static_cast<std::size_t>(first[2] + c);
            const Lanes line = (value[0][0] * p[0] + value[0][1] * p[1]) +
                               (value[0][2] * p[2] + value[0][3] * p[3]);
            const Lanes line_dx = (slope[0][0] * p[0] + slope[0][1] * p[1]) +
                                  (slope[0][2] * p[2] + slope[0][3] * p[3]);
            plane += value[1][b] * line;
            plane_dx += value[1][b] * line_dx;
            plane_dy += slope[1][b] * line;
        }
        d += value[2][c] * plane;
        dx += value[2][c] * plane_dx;
        dy += value[2][c] * plane_dy;
        dz += slope[2][c] * plane;
    }
    for (int r = 0; r < 3; ++r) {
        sample->value[r] += static_cast<double>(d[r]);
        sample->jacobian(r, 0) += static_cast<double>(dx[r]);
        sample->jacobian(r, 1) += static_cast<double>(dy[r]);
        sample->jacobian(r, 2) += static_cast<double>(dz[r]);
    }
}

}  // namespace sonocase::pipeline::inline registration_map
