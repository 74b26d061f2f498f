// SPDX-License-Identifier: Apache-2.0

// The column model of tissue under a probe: the constants of its equations, and the stretch of a
// piece of tissue under a stress. docs/deformation.md derives them and names their sources.
//
// u(x, t) is the shift along the beam of the tissue that lies at rest t below the skin of column x.
// It minimises the energy
//
//   sum over cells  s/2 [ E B u_t^2 + 0.122 E' u_x^2 + 0.351 E' u^2 / s^2 ],
//   s = 1.35 a + 0.30 t,   B = 1 + (b/t)^2,   1/b^2 = 1/a^2 + 1/d^2
//
// where u is the pressed depth at the skin under the face, and 0 at bone and at 71.6 mm. a is half
// the face's extent across the plane and s the width of the field there; d is the distance to the
// edge of the contact, so that b is the half width of the contact in both directions together. In a
// lumen B is 1. E' is E, and 1.93 E in skin.
#pragma once

#include <cmath>

namespace sonocase::runtime::press {

inline constexpr double kWidthPerHalfHeight = 1.35, kWidthPerDepth = 0.30;
inline constexpr double kShear = 0.122, kFoundation = 0.351, kMembrane = 1.93;

inline constexpr double kMinStress = -0.5, kMaxStress = 500;  // in units of the stiffness

// In the last increment a lumen's stress S becomes 2 S + S^2. That is the rest of its closing,
// which the columns beside it cannot bring about.
inline constexpr double kLumenGain = 2, kLumenGrowth = 1;
// A lumen's stretch of 0.3 and less falls linearly to 0.02 at 0.2: its walls touch.
inline constexpr double kClosing = 0.3, kClosed = 0.2, kMinLumen = 0.02;
// A column's way through a lumen is shut where it is lower than this part of its height at rest:
// parts of it have closed by then, and a vein gives way at once and not in layers.
inline constexpr double kShut = 0.38;

// Force on the face: what the tissue of all columns carries at a depth t, and what the tissue above
// has handed on to its sides by then,
//
//     F = sqrt(pi) h sum_i (1 + 0.08 t/mm) s q_i,
//
// q the stress of a row; the mean over the rows with 8 mm < t < 13 mm above the column's bone, or
// the last row above a bone that is nearer. Stress in the skin counts for nothing here: its
// stiffness hands it from column to column, many times the force of the face.
inline constexpr double kHandedOnPerMm = 0.08, kForceFromMm = 8, kForceToMm = 13;

// Tissue that is squeezed along the beam goes sideways within this length, and the rest goes across
// the plane.
inline constexpr double kBulgeLateralMm = 20, kBulgeAxialMm = 4;

inline constexpr double kMaxShare = 0.7;  // share of the depth to bone that can be pressed
inline constexpr double kReachMm = 30;    // the skin is searched for this far behind the face
inline constexpr double kSearchMm = 40;   // and this far in front of it

inline double field_width_mm(double half_height_mm, double depth_mm) {
    return kWidthPerHalfHeight * half_height_mm + kWidthPerDepth * depth_mm;
}

// Across the plane the shift along the beam fades with exp(-y^2 / 2 w^2), and the sideways shift
// with a width 1.25 times as large.
inline constexpr double kLateralFade = 1.25;
inline double fade_width_mm(double half_height_mm, double depth_mm) {
    return 1.25 * half_height_mm + 0.25 * depth_mm;
}

// Stretch l under a stress S in units of the stiffness, compression positive, and -dl/dS:
//   tissue         l = 1 / sqrt(1 + 2 S)
//   open lumen     l = 1 / (sqrt(1 + S^2) + S)
//   in tension     l = 1 - S
struct Stretch {
    double l = 1, slope = 1;
};
inline Stretch tissue_stretch(double s) {
    if (s < 0) return {1 - std::fmax(s, kMinStress), 1};
    const double l = 1 / std::sqrt(1 + 2 * std::fmin(s, kMaxStress));
    return {l, l * l * l};
}
inline Stretch lumen_stretch(double s) {
    if (s < 0) return {1 - std::fmax(s, kMinStress), 1};
    s = std::fmin(s, kMaxStress);
    const double w = std::sqrt(1 + s * s), l = 1 / (w + s);
    return {l, l / w};
}
inline double closing(double l) {
    if (l >= kClosing) return l;
    return std::fmax(kMinLumen, kClosing * (l - kClosed) / (kClosing - kClosed));
}

}  // namespace sonocase::runtime::press
