// SPDX-License-Identifier: Apache-2.0

#include "formats/base/geometry.h"

#include <algorithm>

#include "formats/base/portable_math.h"

namespace sonocase {

Vector3 normalized(Vector3 a) {
    // Scale by the largest component first, so that tiny and huge vectors neither under- nor
    // overflow.
    const double largest = std::max({std::abs(a.x), std::abs(a.y), std::abs(a.z)});
    if (!(largest > 0)) return {0, 0, 0};
    const Vector3 s = a / largest;
    return s / norm(s);
}

Vector3 any_perpendicular(Vector3 a) {
    const Vector3 helper = std::abs(a.x) < 0.9 ? Vector3{1, 0, 0} : Vector3{0, 1, 0};
    return normalized(cross(a, helper));
}

Matrix3 Matrix3::from_columns(Vector3 a, Vector3 b, Vector3 c) {
    return {{a.x, b.x, c.x, a.y, b.y, c.y, a.z, b.z, c.z}};
}

Matrix3 Matrix3::diagonal(Vector3 d) {
    return {{d.x, 0, 0, 0, d.y, 0, 0, 0, d.z}};
}

Matrix3 operator*(const Matrix3& a, const Matrix3& b) {
    Matrix3 out;
    for (int r = 0; r < 3; ++r) {
        for (int c = 0; c < 3; ++c) {
            out(r, c) = a(r, 0) * b(0, c) + a(r, 1) * b(1, c) + a(r, 2) * b(2, c);
        }
    }
    return out;
}

Vector3 operator*(const Matrix3& a, Vector3 v) {
    return {a(0, 0) * v.x + a(0, 1) * v.y + a(0, 2) * v.z,
            a(1, 0) * v.x + a(1, 1) * v.y + a(1, 2) * v.z,
            a(2, 0) * v.x + a(2, 1) * v.y + a(2, 2) * v.z};
}

Matrix3 transpose(const Matrix3& a) {
    return Matrix3::from_columns({a(0, 0), a(0, 1), a(0, 2)}, {a(1, 0), a(1, 1), a(1, 2)},
                                 {a(2, 0), a(2, 1), a(2, 2)});
}

double determinant(const Matrix3& a) {
    return dot(a.column(0), cross(a.column(1), a.column(2)));
}

Matrix3 inverse(const Matrix3& a) {
    const Vector3 c0 = a.column(0), c1 = a.column(1), c2 = a.column(2);
    const double d = determinant(a);
    const Vector3 r0 = cross(c1, c2) / d, r1 = cross(c2, c0) / d, r2 = cross(c0, c1) / d;
    return {{r0.x, r0.y, r0.z, r1.x, r1.y, r1.z, r2.x, r2.y, r2.z}};
}

double orthonormality_error(const Matrix3& r) {
    const Matrix3 g = transpose(r) * r;
    double worst = 0;
    for (int i = 0; i < 3; ++i) {
        for (int j = 0; j < 3; ++j) {
            const double e = std::abs(g(i, j) - (i == j ? 1.0 : 0.0));
            if (!(e <= worst)) worst = e;  // a NaN is kept
        }
    }
    return worst;
}

Matrix3 nearest_rotation(const Matrix3& r) {
    // Newton's iteration for the orthogonal polar factor: X <- (X + X^-T) / 2, quadratic.
    Matrix3 x = r;
    for (int i = 0; i < 12; ++i) {
        const Matrix3 y = transpose(inverse(x));
        double change = 0;
        for (std::size_t k = 0; k < 9; ++k) {
            const double next = 0.5 * (x.m[k] + y.m[k]);
            change = std::max(change, std::abs(next - x.m[k]));
            x.m[k] = next;
        }
        if (change < 1e-15) break;
    }
    return x;
}

Matrix3 rotation_about(Vector3 u, double angle_rad) {
    const double h = std::sin(0.5 * angle_rad);
    return rotation_about(u, std::sin(angle_rad), 2 * h * h);  // 1 - cos without cancellation
}

Matrix3 rotation_about(Vector3 u, double s, double v) {
    return {{1 - v * (u.y * u.y + u.z * u.z), v * u.x * u.y - s * u.z, v * u.x * u.z + s * u.y,
             v * u.x * u.y + s * u.z, 1 - v * (u.x * u.x + u.z * u.z), v * u.y * u.z - s * u.x,
             v * u.x * u.z - s * u.y, v * u.y * u.z + s * u.x, 1 - v * (u.x * u.x + u.y * u.y)}};
}

double rotation_angle(const Matrix3& r) {
    // |axis part| = 2 sin, trace - 1 = 2 cos: atan2 is accurate where acos is not.
    const Vector3 axis{r(2, 1) - r(1, 2), r(0, 2) - r(2, 0), r(1, 0) - r(0, 1)};
    return arc_tangent(norm(axis), r(0, 0) + r(1, 1) + r(2, 2) - 1);
}

Matrix3 rotation_from_quaternion(Quaternion q) {
    const double n = std::sqrt(q.w * q.w + q.x * q.x + q.y * q.y + q.z * q.z);
    const double w = q.w / n, x = q.x / n, y = q.y / n, z = q.z / n;
    return {{1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y), 2 * (x * y + w * z),
             1 - 2 * (x * x + z * z), 2 * (y * z - w * x), 2 * (x * z - w * y), 2 * (y * z + w * x),
             1 - 2 * (x * x + y * y)}};
}

Quaternion quaternion_from_rotation(const Matrix3& r) {
    // Take the largest of the four squared components, so that no small number is divided by.
    const double t = r(0, 0) + r(1, 1) + r(2, 2);
    Quaternion q;
    if (t >= r(0, 0) && t >= r(1, 1) && t >= r(2, 2)) {
        q = {1 + t, r(2, 1) - r(1, 2), r(0, 2) - r(2, 0), r(1, 0) - r(0, 1)};
    } else if (r(0, 0) >= r(1, 1) && r(0, 0) >= r(2, 2)) {
        q = {r(2, 1) - r(1, 2), 1 + 2 * r(0, 0) - t, r(0, 1) + r(1, 0), r(0, 2) + r(2, 0)};
    } else if (r(1, 1) >= r(2, 2)) {
        q = {r(0, 2) - r(2, 0), r(0, 1) + r(1, 0), 1 + 2 * r(1, 1) - t, r(1, 2) + r(2, 1)};
    } else {
        q = {r(1, 0) - r(0, 1), r(0, 2) + r(2, 0), r(1, 2) + r(2, 1), 1 + 2 * r(2, 2) - t};
    }
    const double n = std::sqrt(q.w * q.w + q.x * q.x + q.y * q.y + q.z * q.z);
    const double s = (q.w < 0 ? -1 : 1) / n;
    return {s * q.w, s * q.x, s * q.y, s * q.z};
}

Point3 operator*(const Rigid& t, Point3 p) {
    const Vector3 v = t.rotation * Vector3{p.x, p.y, p.z} + t.translation;
    return {v.x, v.y, v.z};
}

Vector3 operator*(const Rigid& t, Vector3 v) {
    return t.rotation * v;
}

Rigid operator*(const Rigid& a, const Rigid& b) {
    return {a.rotation * b.rotation, a.rotation * b.translation + a.translation};
}

Rigid inverse(const Rigid& t) {
    const Matrix3 r = transpose(t.rotation);
    return {r, -(r * t.translation)};
}

bool is_finite(const Rigid& t) {
    for (double v : t.rotation.m) {
        if (!std::isfinite(v)) return false;
    }
    return std::isfinite(t.translation.x) && std::isfinite(t.translation.y) &&
           std::isfinite(t.translation.z);
}

void Box3::include(Point3 p) {
    for (int i = 0; i < 3; ++i) {
        lower[i] = std::min(lower[i], p[i]);
        upper[i] = std::max(upper[i], p[i]);
    }
}

bool Box3::contains(Point3 p) const {
    return p.x >= lower.x && p.x <= upper.x && p.y >= lower.y && p.y <= upper.y && p.z >= lower.z &&
           p.z <= upper.z;
}

}  // namespace sonocase
