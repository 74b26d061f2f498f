// SPDX-License-Identifier: Apache-2.0

// How tissue around a needle moves: it tents before the tip, and is dragged along the shaft behind
// it, where it turns like a wheel.
//
// Both are one field without change of volume, the curl of a Gaussian, in the needle's frame
// (origin at the tip, z from hub to tip, rho from the axis):
//
//     G(q, w, b, z0):   u_z = q (1 - rho^2 / 2 w^2) g,   u_rho = q rho (z - z0) / (2 b^2) g,
//                       g = exp(-rho^2 / 2 w^2 - (z - z0)^2 / 2 b^2)
//
// tenting  G(d, 4, 4, 0);   rolling drag  G(q, 0.948, 3, -4.53), which turns about rho = sqrt(2) w
// = 1.34 mm, 4.53 mm behind the tip. The map p - u(p) does not fold while q < sqrt(e) b, which is
// 6.6 mm for tenting and 4.9 for drag; kMaxTentMm and kMaxDragMm stay within half of that.
// Source: docs/deformation.md. Constant time, no allocation.
#pragma once

#include "formats/base/geometry.h"

namespace sonocase::runtime {

struct NeedleZone {
    double width_mm, length_mm, middle_mm;  // w, b, z0
};
inline constexpr NeedleZone kTentZone{4, 4, 0}, kDragZone{0.948, 3, -4.53};

inline constexpr double kMaxTentMm = 0.8 * kTentZone.length_mm;
inline constexpr double kMaxDragMm = 0.5;

// G above, of strength q, at a point of the frame `needle`.
Vector3 zone_shift(const NeedleZone& zone, double strength_mm, Point3 needle);

// Shift of the tissue that is now at a point: it lay at rest at the point less this.
Vector3 needle_shift(double tent_mm, double drag_mm, Point3 needle);

// A needle that moves tissue, in any frame.
struct NeedleDent {
    Point3 tip;
    Vector3 axis;  // unit, from hub to tip
    double tent_mm = 0, drag_mm = 0;
    bool moves() const { return tent_mm != 0 || drag_mm != 0; }
};

// A dent within its limits; one that is not finite counts as none.
NeedleDent bounded_dent(Point3 tip, Vector3 axis, double tent_mm, double drag_mm);

// Nothing moves further from the tip than this, by more than 0.002 mm.
inline constexpr double kDentReachMm = 16;

// Shift of the tissue that is now at a point of the dent's frame.
Vector3 dent_shift(const NeedleDent& dent, Point3 p);

}  // namespace sonocase::runtime
