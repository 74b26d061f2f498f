// SPDX-License-Identifier: Apache-2.0

// Points, directions, rotations and rigid motions. Millimetres, radians, right-handed frames.
//
// Transforms read destination first, so that neighbouring names cancel:
//     tip_world = world_from_needle_sensor * needle_sensor_from_needle * tip_needle
// Point3 and Vector3 are different types: a point is translated, a direction is not.
// Everything here is constant time, allocates nothing and may run in the frame loop.
#pragma once

#include <array>
#include <cmath>
#include <cstdint>

namespace sonocase {

struct Vector3 {
    double x = 0, y = 0, z = 0;
    double operator[](int i) const { return i == 0 ? x : i == 1 ? y : z; }
    double& operator[](int i) { return i == 0 ? x : i == 1 ? y : z; }
    friend bool operator==(const Vector3&, const Vector3&) = default;
};

struct Point3 {
    double x = 0, y = 0, z = 0;
    double operator[](int i) const { return i == 0 ? x : i == 1 ? y : z; }
    double& operator[](int i) { return i == 0 ? x : i == 1 ? y : z; }
    friend bool operator==(const Point3&, const Point3&) = default;
};

struct Int3 {
    std::int32_t x = 0, y = 0, z = 0;
    std::int32_t operator[](int i) const { return i == 0 ? x : i == 1 ? y : z; }
    std::int32_t& operator[](int i) { return i == 0 ? x : i == 1 ? y : z; }
    friend bool operator==(const Int3&, const Int3&) = default;
};

inline Vector3 operator+(Vector3 a, Vector3 b) {
    return {a.x + b.x, a.y + b.y, a.z + b.z};
}
inline Vector3 operator-(Vector3 a, Vector3 b) {
    return {a.x - b.x, a.y - b.y, a.z - b.z};
}
inline Vector3 operator-(Vector3 a) {
    return {-a.x, -a.y, -a.z};
}
inline Vector3 operator*(double s, Vector3 a) {
    return {s * a.x, s * a.y, s * a.z};
}
inline Vector3 operator*(Vector3 a, double s) {
    return s * a;
}
inline Vector3 operator/(Vector3 a, double s) {
    return {a.x / s, a.y / s, a.z / s};
}
inline Point3 operator+(Point3 p, Vector3 v) {
    return {p.x + v.x, p.y + v.y, p.z + v.z};
}
inline Point3 operator-(Point3 p, Vector3 v) {
    return {p.x - v.x, p.y - v.y, p.z - v.z};
}
inline Vector3 operator-(Point3 a, Point3 b) {
    return {a.x - b.x, a.y - b.y, a.z - b.z};
}

inline double dot(Vector3 a, Vector3 b) {
    return a.x * b.x + a.y * b.y + a.z * b.z;
}
inline Vector3 cross(Vector3 a, Vector3 b) {
    return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}
inline double norm(Vector3 a) {
    return std::sqrt(dot(a, a));
}
inline double distance(Point3 a, Point3 b) {
    return norm(a - b);
}
// Unit vector along a; zero stays zero.
Vector3 normalized(Vector3 a);
// Some unit vector at right angles to the unit vector a, continuous except at one direction.
Vector3 any_perpendicular(Vector3 a);

// 3 x 3 matrix, row by row. Columns of a rotation are the source axes seen in the destination.
struct Matrix3 {
    std::array<double, 9> m{1, 0, 0, 0, 1, 0, 0, 0, 1};
    double operator()(int row, int column) const { return m[3 * row + column]; }
    double& operator()(int row, int column) { return m[3 * row + column]; }
    Vector3 column(int c) const { return {(*this)(0, c), (*this)(1, c), (*this)(2, c)}; }
    static Matrix3 from_columns(Vector3 a, Vector3 b, Vector3 c);
    static Matrix3 diagonal(Vector3 d);
    friend bool operator==(const Matrix3&, const Matrix3&) = default;
};

Matrix3 operator*(const Matrix3& a, const Matrix3& b);
Vector3 operator*(const Matrix3& a, Vector3 v);
Matrix3 transpose(const Matrix3& a);
double determinant(const Matrix3& a);
// Inverse by cofactors; the caller checks that the determinant is not zero.
Matrix3 inverse(const Matrix3& a);

// Greatest absolute entry of R^T R - I: 0 for an exact rotation or mirror.
double orthonormality_error(const Matrix3& r);
// The rotation nearest to r (polar decomposition by Newton iteration); r must have det > 0.
Matrix3 nearest_rotation(const Matrix3& r);

// Rotation by angle_rad about a unit axis, right-handed (Rodrigues).
Matrix3 rotation_about(Vector3 unit_axis, double angle_rad);
// The same from the angle's sine and from 1 less its cosine, without trigonometry: the same bits on
// every platform.
Matrix3 rotation_about(Vector3 unit_axis, double sine, double one_less_cosine);
// Angle of a rotation in [0, pi], accurate at both ends.
double rotation_angle(const Matrix3& r);

// Unit quaternion, scalar first.
struct Quaternion {
    double w = 1, x = 0, y = 0, z = 0;
};
Matrix3 rotation_from_quaternion(Quaternion q);         // q is normalised first
Quaternion quaternion_from_rotation(const Matrix3& r);  // w >= 0

// Rigid motion: p_to = rotation * p_from + translation.
struct Rigid {
    Matrix3 rotation;
    Vector3 translation;
    friend bool operator==(const Rigid&, const Rigid&) = default;
};

Point3 operator*(const Rigid& t, Point3 p);
Vector3 operator*(const Rigid& t, Vector3 v);
Rigid operator*(const Rigid& a, const Rigid& b);
Rigid inverse(const Rigid& t);
bool is_finite(const Rigid& t);

// Axis-aligned box; lower <= upper in each axis, or empty as made by default.
struct Box3 {
    Point3 lower{INFINITY, INFINITY, INFINITY};
    Point3 upper{-INFINITY, -INFINITY, -INFINITY};
    void include(Point3 p);
    bool contains(Point3 p) const;
    bool empty() const { return !(lower.x <= upper.x); }
    Vector3 extent() const { return upper - lower; }
    Point3 centre() const { return lower + 0.5 * (upper - lower); }
};

}  // namespace sonocase
