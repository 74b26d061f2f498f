// SPDX-License-Identifier: Apache-2.0

#include "formats/markers/camera_model.h"

#include <algorithm>
#include <cmath>

#include "formats/base/constants.h"

namespace sonocase {
namespace {

// The distorted place of an undistorted (x, y) at z = 1, and its derivatives.
struct Distorted {
    double x, y, xx, xy, yx, yy;  // xy: of x by y
};

Distorted distort(const CameraModel& c, double x, double y) {
    const double r2 = x * x + y * y;
    const double radial = 1 + r2 * (c.k1 + r2 * (c.k2 + r2 * c.k3));
    const double slope = 2 * (c.k1 + r2 * (2 * c.k2 + r2 * 3 * c.k3));  // d radial / d r2, twice
    return {x * radial + 2 * c.p1 * x * y + c.p2 * (r2 + 2 * x * x),
            y * radial + c.p1 * (r2 + 2 * y * y) + 2 * c.p2 * x * y,
            radial + x * x * slope + 2 * c.p1 * y + 6 * c.p2 * x,
            x * y * slope + 2 * c.p1 * x + 2 * c.p2 * y,
            x * y * slope + 2 * c.p1 * x + 2 * c.p2 * y,
            radial + y * y * slope + 6 * c.p1 * y + 2 * c.p2 * x};
}

}  // namespace

CameraModel assumed_camera(int width_px, int height_px, double view_deg) {
    CameraModel c;
    c.width_px = width_px;
    c.height_px = height_px;
    c.fx_px = c.fy_px = 0.5 * width_px / std::tan(0.5 * view_deg * kPi / 180);
    c.cx_px = 0.5 * (width_px - 1);
    c.cy_px = 0.5 * (height_px - 1);
    return c;
}

Result<CameraModel> at_size(const CameraModel& camera, int width_px, int height_px) {
    CameraModel c = camera;
    if (width_px == c.width_px && height_px == c.height_px) return c;
    const double scale = static_cast<double>(width_px) / c.width_px;
    if (std::abs(height_px - scale * c.height_px) > 1) {
        return Error{Message("pictures of {} x {}, but the camera was calibrated at {} x {}",
                             {std::to_string(width_px), std::to_string(height_px),
                              std::to_string(c.width_px), std::to_string(c.height_px)}),
                     "camera", "calibrate it at this size"};
    }
    c.width_px = width_px;
    c.height_px = height_px;
    c.fx_px *= scale;
    c.fy_px *= scale;
    c.cx_px = (c.cx_px + 0.5) * scale - 0.5;
    c.cy_px = (c.cy_px + 0.5) * scale - 0.5;
    c.sigma_focal_px *= c.sigma_focal_px > 0 ? scale : 1;
    return c;
}

bool project(const CameraModel& c, Vector3 p, Pixel& pixel, double* jacobian) {
    constexpr double kNearest = 1;  // mm
    if (!(p.z > kNearest)) return false;
    const double iz = 1 / p.z, x = p.x * iz, y = p.y * iz;
    const Distorted d = distort(c, x, y);
    pixel = {c.fx_px * d.x + c.cx_px, c.fy_px * d.y + c.cy_px};
    if (jacobian) {
        jacobian[0] = c.fx_px * d.xx * iz;
        jacobian[1] = c.fx_px * d.xy * iz;
        jacobian[2] = -c.fx_px * (d.xx * x + d.xy * y) * iz;
        jacobian[3] = c.fy_px * d.yx * iz;
        jacobian[4] = c.fy_px * d.yy * iz;
        jacobian[5] = -c.fy_px * (d.yx * x + d.yy * y) * iz;
    }
    return true;
}

Vector3 direction_at(const CameraModel& c, Pixel pixel) {
    const double u = (pixel.x - c.cx_px) / c.fx_px, v = (pixel.y - c.cy_px) / c.fy_px;
    double x = u, y = v;
    for (int i = 0; i < 12; ++i) {
        const Distorted d = distort(c, x, y);
        const double det = d.xx * d.yy - d.xy * d.yx;
        if (!(det > 1e-6)) break;  // beyond the bend of the polynomial there is no inverse
        const double ex = d.x - u, ey = d.y - v;
        x -= (d.yy * ex - d.xy * ey) / det;
        y -= (d.xx * ey - d.yx * ex) / det;
        if (std::abs(ex) + std::abs(ey) < 1e-12) break;
    }
    return {x, y, 1};
}

}  // namespace sonocase
