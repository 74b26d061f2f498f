// SPDX-License-Identifier: Apache-2.0

// How much of the scan plane's thickness the needle fills at a point of the plane.
//
// The needle is a cylinder of radius rho that ends at the tip; the plane is a slab |y| <= t / 2. At
// (x, 0, z) the share is the length of the segment {(x, y, z), |y| <= t / 2} inside the cylinder,
// over t: the partial volume of [Magee], "Needle Rendering". With w(y) = (x, y, z) - tip and the
// unit axis a,
//     |w - (w.a) a|^2 <= rho^2   is a quadratic in y,   -length <= w.a <= 0   an interval.
// All in the probe frame, mm. Constant time.
#pragma once

#include <algorithm>
#include <cmath>

#include "formats/base/geometry.h"
#include "formats/exercise/exercise.h"

namespace sonocase::runtime {

inline constexpr double kTipReachMm = 40;  // model paper: from tip to shaft opacity, linearly

struct NeedleShape {
    Point3 tip;    // probe frame
    Vector3 axis;  // unit, hub to tip
    double radius_mm = 0.5;
    double length_mm = 150;
    double slab_mm = 1;  // t; 0 is treated as a thin slab of kThinnestSlabMm
    double tip_opacity = 1, shaft_opacity = 1;
};

inline constexpr double kThinnestSlabMm = 1e-3;

inline NeedleShape needle_shape(const NeedleModel& model, Point3 tip_probe, Vector3 axis_probe) {
    const double diameter = needle_diameter_mm(model);
    return {tip_probe,
            axis_probe,
            0.5 * diameter,
            model.length_mm,
            std::max(model.slab_mm > 0 ? model.slab_mm : diameter, kThinnestSlabMm),
            model.tip_visibility,
            model.shaft_visibility};
}

// Share in [0, 1]; `along` receives the distance from the tip back along the shaft, mm, >= 0.
inline double needle_share(const NeedleShape& n, double x, double z, double& along) {
    const double wx = x - n.tip.x, wy = -n.tip.y, wz = z - n.tip.z;
    const double u0 = wx * n.axis.x + wy * n.axis.y + wz * n.axis.z;
    double low = -0.5 * n.slab_mm, high = 0.5 * n.slab_mm;
    const double a = 1 - n.axis.y * n.axis.y;
    const double b = wy - u0 * n.axis.y;
    const double c = wx * wx + wy * wy + wz * wz - u0 * u0 - n.radius_mm * n.radius_mm;
    along = std::max(-u0, 0.0);
    if (a > 1e-6) {
        const double disc = b * b - a * c;
        if (disc <= 0) return 0;
        const double root = std::sqrt(disc);
        low = std::max(low, (-b - root) / a);
        high = std::min(high, (-b + root) / a);
    } else if (c > 0) {
        return 0;
    }
    if (std::abs(n.axis.y) > 1e-6) {
        const double y0 = (-n.length_mm - u0) / n.axis.y, y1 = -u0 / n.axis.y;
        low = std::max(low, std::min(y0, y1));
        high = std::min(high, std::max(y0, y1));
    } else if (u0 > 0 || u0 < -n.length_mm) {
        return 0;
    }
    return std::max(high - low, 0.0) / n.slab_mm;
}

}  // namespace sonocase::runtime
