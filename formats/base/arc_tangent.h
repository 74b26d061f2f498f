// SPDX-License-Identifier: Apache-2.0

// The angle of a vector in the plane, with the same bits on every platform: C libraries differ in
// the last digit of atan2, and a score shall be the same on a desktop and in a browser.
#pragma once

namespace sonocase {

// As std::atan2: radians in [-pi, pi]; 0 where both are 0; not a number where either is.
// Within two units in the last place. Additions, products and quotients alone.
// Source: rational approximation of S. Moshier's Cephes library (atan.c), on [0, 0.66].
double arc_tangent(double y, double x);

}  // namespace sonocase
