// SPDX-License-Identifier: Apache-2.0

#include "formats/base/arc_tangent.h"

#include <cmath>
#include <initializer_list>
#include <limits>

namespace sonocase {
namespace {

constexpr double kQuarterTurn = 1.5707963267948966;       // pi / 2
constexpr double kRestOfQuarter = 6.123233995736766e-17;  // what rounding took from it

// atan(t) for |t| <= 0.66: t + t^3 P(t^2) / Q(t^2).
double of_small(double t) {
    const double z = t * t;
    double p = -0.8750608600031904;
    for (const double c :
         {-16.157537187333652, -75.00855792314705, -122.88666844901361, -64.85021904942025})
        p = p * z + c;
    double q = 1;
    for (const double c : {24.858464901423062, 165.02700983169885, 432.88106049129027,
                           485.3903996359137, 194.5506571482614})
        q = q * z + c;
    return t + t * (z * p / q);
}

// atan(t) for t >= 0, infinity included.
double of_positive(double t) {
    if (t <= 0.66) return of_small(t);
    if (t > 2.414213562373095)  // tan(3 pi / 8)
        return kQuarterTurn + (of_small(-1 / t) + kRestOfQuarter);
    return 0.5 * kQuarterTurn + (of_small((t - 1) / (t + 1)) + 0.5 * kRestOfQuarter);
}

}  // namespace

double arc_tangent(double y, double x) {
    if (std::isnan(x) || std::isnan(y)) return std::numeric_limits<double>::quiet_NaN();
    const double up = std::fabs(y), along = std::fabs(x);
    double angle = 0;
    if (up == along && up != 0) {  // infinities, too
        angle = 0.5 * kQuarterTurn;
    } else if (up != 0) {
        angle = of_positive(up / along);
    }
    if (std::signbit(x)) angle = 2 * kQuarterTurn - (angle - 2 * kRestOfQuarter);
    return std::copysign(angle, y);
}

}  // namespace sonocase
