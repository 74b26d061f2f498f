// SPDX-License-Identifier: Apache-2.0

// The camera of formats/markers/camera_model.h and a tag in its picture, for Ceres' numbers with
// derivatives.
#pragma once

#include <cmath>

#include "formats/markers/body_pose.h"

namespace sonocase::pipeline::inline calibration {

inline constexpr int kIntrinsics = 9;  // fx, fy, cx, cy, k1, k2, p1, p2, k3

// Where a point in front of the camera appears. camera: kIntrinsics; point: x, y, z, mm.
template <class T>
void lens_pixel(const T* camera, const T* point, T* pixel) {
    const T x = point[0] / point[2], y = point[1] / point[2], r2 = x * x + y * y;
    const T radial = 1.0 + r2 * (camera[4] + r2 * (camera[5] + r2 * camera[8]));
    const T u = x * radial + 2.0 * camera[6] * x * y + camera[7] * (r2 + 2.0 * x * x);
    const T v = y * radial + camera[6] * (r2 + 2.0 * y * y) + 2.0 * camera[7] * x * y;
    pixel[0] = camera[0] * u + camera[2];
    pixel[1] = camera[1] * v + camera[3];
}

// The outward move of all edges (body_pose.h), held near nothing.
struct BleedCost {
    template <class T>
    bool operator()(const T* bleed, T* residual) const {
        residual[0] = bleed[0] / kBleed;
        return true;
    }
};

// How far a tag's corners are seen from where they should be, x0, y0, x1, ..., pixels. view: the
// corners before the camera, mm.
template <class T>
void tag_off_px(
    const T* camera, const T (&view)[4][3], const T& bleed, const SeenTag& seen, T* off) {
    using std::hypot;  // of Ceres' numbers: its own
    T at[4][2];
    for (int k = 0; k < 4; ++k) lens_pixel(camera, view[k], at[k]);
    for (int k = 0; k < 4; ++k) {
        const T *a = at[(k + 3) % 4], *b = at[k], *c = at[(k + 1) % 4];
        const T in = hypot(b[0] - a[0], b[1] - a[1]);
        const T on = hypot(c[0] - b[0], c[1] - b[1]);
        for (int axis = 0; axis < 2; ++axis)
            off[2 * k + axis] = b[axis] +
                                bleed * ((b[axis] - a[axis]) / in - (c[axis] - b[axis]) / on) -
                                (axis == 0 ? seen.corners[k].x : seen.corners[k].y);
    }
}
// The same in standard deviations that are independent of one another.
inline constexpr double kHuberOfTag = 7;  // of the eight numbers together
template <class T>
void whiten(const SeenTag& seen, const T* off, T* residual) {
    for (int r = 0; r < 8; ++r) {
        residual[r] = T(0);
        for (int c = r; c < 8; ++c) residual[r] += seen.whitening[8 * r + c] * off[c];
    }
}

}  // namespace sonocase::pipeline::inline calibration
