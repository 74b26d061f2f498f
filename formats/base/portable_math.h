// SPDX-License-Identifier: Apache-2.0

// Sine, cosine, exponential and arc tangent with the same bits on every platform: C libraries
// differ in their last digit, and a score must be the same on a desktop and in a browser.
#pragma once

namespace sonocase {

// As std::sin and std::cos, within two units in the last place, or 1e-16 near a zero, for
// |x| <= 1e6; beyond, the error grows with x. NaN for infinities.
// Argument less a multiple of pi / 2 in three parts (Cody and Waite), then Taylor's series.
double sine(double x);
double cosine(double x);

// As std::exp, within two units in the last place; 0 below -745, infinity above 709.7.
double exponential(double x);

// Length of a vector in the plane. Differs from std::hypot where the squares overflow or vanish.
double hypotenuse(double x, double y);

// As std::atan2: radians in [-pi, pi]; 0 where both are 0; NaN where either is.
// Within two units in the last place. Additions, products and quotients alone.
// Source: rational approximation of S. Moshier's Cephes library (atan.c), on [0, 0.66].
double arc_tangent(double y, double x);

// e^-q for q >= 0, relative error 3e-8; 0 beyond 60. Faster than exponential(): e^(-q/256) by its
// series, squared eight times.
inline double falling_exponential(double q) {
    if (!(q < 60)) return 0;
    const double x = -q / 256;
    double e = 1 + x * (1 + x / 2 * (1 + x / 3 * (1 + x / 4 * (1 + x / 5))));
    for (int i = 0; i < 8; ++i) e *= e;
    return e;
}

}  // namespace sonocase
