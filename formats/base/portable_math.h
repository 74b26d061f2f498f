// SPDX-License-Identifier: Apache-2.0

// Sine, cosine and exponential with the same bits on every platform: C libraries differ in their
// last digit, and a score shall be the same on a desktop and in a browser.
// formats/base/arc_tangent.h has the angle of a vector.
#pragma once

namespace sonocase {

// As std::sin and std::cos, within two units in the last place, or 1e-16 near a zero, for
// |x| <= 1e6; beyond, the error grows with x. Not a number for infinities.
// Argument less a multiple of pi / 2 in three parts (Cody and Waite), then Taylor's series.
double sine(double x);
double cosine(double x);

// As std::exp, within two units in the last place; 0 below -745, infinity above 709.7.
double exponential(double x);

// Length of a vector in the plane; unlike std::hypot for lengths whose squares overflow or vanish.
double hypotenuse(double x, double y);

}  // namespace sonocase
