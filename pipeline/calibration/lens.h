// SPDX-License-Identifier: Apache-2.0

// The camera of formats/markers/camera_model.h, for Ceres' numbers with derivatives.
#pragma once

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

}  // namespace sonocase::pipeline::inline calibration
