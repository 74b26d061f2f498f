// SPDX-License-Identifier: Apache-2.0

#include "formats/base/portable_math.h"

#include <cmath>
#include <initializer_list>
#include <limits>

namespace sonocase {
namespace {

// pi / 2 in parts: the first two end in 20 and more zero bits, so that small multiples are exact.
constexpr double kQuarterHigh = 0x1.921fb544p+0;
constexpr double kQuarterMiddle = 0x1.0b4611a6p-34;
constexpr double kQuarterLow = 0x1.3198a2e037073p-69;
constexpr double kQuarterTurn = 1.5707963267948966;         // pi / 2
constexpr double kQuarterTurnRest = 6.123233995736766e-17;  // what rounding took from it
constexpr double kLnHigh = 0x1.62e42feep-1;                 // ln 2
constexpr double kLnLow = 0x1.a39ef35793c76p-33;

// Taylor's series for |r| <= pi / 4: the first term left out is below 1e-19.
double small_sine(double r) {
    const double z = r * r;
    double sum = 1;
    for (int n = 18; n >= 2; n -= 2) sum = 1 - z / (n * (n + 1.0)) * sum;
    return r * sum;
}
double small_cosine(double r) {
    const double z = r * r;
    double sum = 1;
    for (int n = 19; n >= 3; n -= 2) sum = 1 - z / (n * (n + 1.0)) * sum;
    return 1 - (0.5 * z) * sum;
}

// x plus `turns` quarter turns.
double sine_turned(double x, int turns) {
    if (!std::isfinite(x)) return std::numeric_limits<double>::quiet_NaN();
    const double k = std::floor(x * 0.63661977236758134 + 0.5);  // 2 / pi
    const double r = ((x - k * kQuarterHigh) - k * kQuarterMiddle) - k * kQuarterLow;
    const double whole = k + turns;
    const int quarter = static_cast<int>(whole - 4 * std::floor(whole / 4));
    const double value = quarter % 2 == 0 ? small_sine(r) : small_cosine(r);
    return quarter < 2 ? value : -value;
}

// atan(t) for |t| <= 0.66: t + t^3 P(t^2) / Q(t^2).
double small_arc_tangent(double t) {
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
double positive_arc_tangent(double t) {
    if (t <= 0.66) return small_arc_tangent(t);
    if (t > 2.414213562373095)  // tan(3 pi / 8)
        return kQuarterTurn + (small_arc_tangent(-1 / t) + kQuarterTurnRest);
    return 0.5 * kQuarterTurn + (small_arc_tangent((t - 1) / (t + 1)) + 0.5 * kQuarterTurnRest);
}

}  // namespace

double sine(double x) {
    return sine_turned(x, 0);
}

double cosine(double x) {
    return sine_turned(x, 1);
}

double exponential(double x) {
    if (std::isnan(x)) return x;
    if (x > 709.782712893384) return std::numeric_limits<double>::infinity();
    if (x < -745.2) return 0;
    const double k = std::floor(x * 1.4426950408889634 + 0.5);  // 1 / ln 2
    const double r = (x - k * kLnHigh) - k * kLnLow;
    double sum = 1;
    for (int n = 16; n >= 2; --n) sum = 1 + r / n * sum;
    return std::ldexp(1 + r * sum, static_cast<int>(k));
}

double hypotenuse(double x, double y) {
    return std::sqrt(x * x + y * y);
}

double arc_tangent(double y, double x) {
    if (std::isnan(x) || std::isnan(y)) return std::numeric_limits<double>::quiet_NaN();
    const double up = std::fabs(y), along = std::fabs(x);
    double angle = 0;
    if (up == along && up != 0) {  // infinities, too
        angle = 0.5 * kQuarterTurn;
    } else if (up != 0) {
        angle = positive_arc_tangent(up / along);
    }
    if (std::signbit(x)) angle = 2 * kQuarterTurn - (angle - 2 * kQuarterTurnRest);
    return std::copysign(angle, y);
}

}  // namespace sonocase
