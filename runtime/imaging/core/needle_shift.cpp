// SPDX-License-Identifier: Apache-2.0

#include "runtime/imaging/core/needle_shift.h"

#include <algorithm>
#include <cmath>

#include "formats/base/portable_math.h"

namespace sonocase::runtime {

Vector3 zone_shift(const NeedleZone& zone, double strength_mm, Point3 p) {
    const double rho2 = p.x * p.x + p.y * p.y, z = p.z - zone.middle_mm;
    const double w2 = 2 * zone.width_mm * zone.width_mm;
    const double b2 = 2 * zone.length_mm * zone.length_mm;
    const double g = strength_mm * falling_exponential(rho2 / w2 + z * z / b2);
    const double outward = g * z / b2;
    return {outward * p.x, outward * p.y, g * (1 - rho2 / w2)};
}

Vector3 needle_shift(double tent_mm, double drag_mm, Point3 needle) {
    return zone_shift(kTentZone, tent_mm, needle) + zone_shift(kDragZone, drag_mm, needle);
}

NeedleDent bounded_dent(Point3 tip, Vector3 axis, double tent_mm, double drag_mm) {
    if (!std::isfinite(tent_mm) || !std::isfinite(drag_mm)) return {tip, axis};
    return {tip, axis, std::clamp(tent_mm, 0.0, kMaxTentMm),
            std::clamp(drag_mm, -kMaxDragMm, kMaxDragMm)};
}

Vector3 dent_shift(const NeedleDent& dent, Point3 p) {
    const Vector3 q = p - dent.tip;
    if (!(dot(q, q) < kDentReachMm * kDentReachMm)) return {};
    const double along = dot(q, dent.axis);
    const Vector3 beside = q - along * dent.axis;
    const double rho = norm(beside);
    const Vector3 u = needle_shift(dent.tent_mm, dent.drag_mm, {rho, 0, along});
    return rho > 0 ? u.z * dent.axis + (u.x / rho) * beside : u.z * dent.axis;
}

}  // namespace sonocase::runtime
