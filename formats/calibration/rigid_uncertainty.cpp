// SPDX-License-Identifier: Apache-2.0

#include "formats/calibration/rigid_uncertainty.h"

#include <algorithm>
#include <cmath>

namespace sonocase {

Point3 RigidFit::map(Point3 p) const {
    return to_from * Point3{scale * p.x, scale * p.y, scale * p.z};
}

double RigidFit::target_sigma_mm(Point3 p) const {
    const Vector3 x = scale * (to_from.rotation * (p - centroid_from));
    double trace = 0;
    for (int c = 0; c < 3; ++c) {
        std::array<double, 7> row{};
        for (int k = 0; k < 3; ++k) {
            Vector3 e;
            e[k] = 1;
            row[static_cast<std::size_t>(k)] = cross(e, x)[c];
        }
        row[static_cast<std::size_t>(3 + c)] = 1;
        row[6] = x[c] / scale;
        for (std::size_t i = 0; i < 7; ++i) {
            for (std::size_t j = 0; j < 7; ++j) {
                if (row[i] != 0 && row[j] != 0) trace += row[i] * row[j] * covariance[7 * i + j];
            }
        }
    }
    return std::sqrt(std::max(0.0, trace));
}

namespace calibrate {

void fill_uncertainty(const LeastSquaresFit& jacobian,
                      double size,
                      double variance,
                      RigidFit& out) {
    const auto unit = [size](int k) { return k < 3 || k == 6 ? 1 / size : 1.0; };
    for (int i = 0; i < jacobian.unknowns; ++i) {
        for (int j = 0; j < jacobian.unknowns; ++j) {
            const double q = jacobian.covariance(i, j);
            out.covariance[static_cast<std::size_t>(7 * i + j)] =
                std::isinf(q) ? q : variance * q * unit(i) * unit(j);
        }
    }
    const auto root = [&](int k) {
        return std::sqrt(std::max(0.0, out.covariance[static_cast<std::size_t>(8 * k)]));
    };
    out.sigma_rad = {root(0), root(1), root(2)};
    out.sigma_mm = {root(3), root(4), root(5)};
    out.sigma_scale = root(6);
    out.condition = jacobian.rank < jacobian.unknowns ? INFINITY : jacobian.condition();
}

}  // namespace calibrate
}  // namespace sonocase
