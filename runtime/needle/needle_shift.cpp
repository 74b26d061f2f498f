// SPDX-License-Identifier: Apache-2.0

#include "runtime/needle/needle_shift.h"

#include "formats/base/falling_exponential.h"

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

}  // namespace sonocase::runtime
