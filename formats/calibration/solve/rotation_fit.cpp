// SPDX-License-Identifier: Apache-2.0

#include "formats/calibration/solve/rotation_fit.h"

#include <cmath>

namespace sonocase::calibrate {

// Horn's quaternion: the eigenvector of the largest eigenvalue, by Jacobi rotations.
Matrix3 horn_rotation(std::span<const Vector3> from, std::span<const Vector3> to) {
    double s[3][3] = {};
    for (std::size_t i = 0; i < from.size(); ++i) {
        for (int r = 0; r < 3; ++r) {
            for (int c = 0; c < 3; ++c) s[r][c] += from[i][r] * to[i][c];
        }
    }
    double a[4][4] = {
        {s[0][0] + s[1][1] + s[2][2], s[1][2] - s[2][1], s[2][0] - s[0][2], s[0][1] - s[1][0]},
        {0, s[0][0] - s[1][1] - s[2][2], s[0][1] + s[1][0], s[2][0] + s[0][2]},
        {0, 0, -s[0][0] + s[1][1] - s[2][2], s[1][2] + s[2][1]},
        {0, 0, 0, -s[0][0] - s[1][1] + s[2][2]}};
    for (int r = 0; r < 4; ++r) {
        for (int c = 0; c < r; ++c) a[r][c] = a[c][r];
    }
    double v[4][4] = {{1, 0, 0, 0}, {0, 1, 0, 0}, {0, 0, 1, 0}, {0, 0, 0, 1}};
    for (int sweep = 0; sweep < 40; ++sweep) {
        double off = 0, on = 0;
        for (int r = 0; r < 4; ++r) {
            for (int c = 0; c < 4; ++c) (r == c ? on : off) += a[r][c] * a[r][c];
        }
        if (off <= 1e-34 * on) break;
        for (int p = 0; p < 3; ++p) {
            for (int q = p + 1; q < 4; ++q) {
                if (a[p][q] == 0) continue;
                const double zeta = (a[q][q] - a[p][p]) / (2 * a[p][q]);
                const double t = std::copysign(1 / (std::abs(zeta) + std::hypot(1.0, zeta)), zeta);
                const double c = 1 / std::hypot(1.0, t), sn = c * t;
                for (int k = 0; k < 4; ++k) {
                    const double kp = a[k][p], kq = a[k][q];
                    a[k][p] = c * kp - sn * kq;
                    a[k][q] = sn * kp + c * kq;
                }
                for (int k = 0; k < 4; ++k) {
                    const double pk = a[p][k], qk = a[q][k];
                    a[p][k] = c * pk - sn * qk;
                    a[q][k] = sn * pk + c * qk;
                    const double vp = v[k][p], vq = v[k][q];
                    v[k][p] = c * vp - sn * vq;
                    v[k][q] = sn * vp + c * vq;
                }
            }
        }
    }
    int best = 0;
    for (int k = 1; k < 4; ++k) {
        if (a[k][k] > a[best][best]) best = k;
    }
    return rotation_from_quaternion({v[0][best], v[1][best], v[2][best], v[3][best]});
}

Matrix3 rotation_from_vector(Vector3 w) {
    const double angle = norm(w);
    return angle > 0 ? rotation_about(w / angle, angle) : Matrix3{};
}

}  // namespace sonocase::calibrate
