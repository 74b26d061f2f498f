// SPDX-License-Identifier: Apache-2.0

#include "pipeline/anatomy/torso/trunk.h"

#include <cmath>

namespace sonocase::pipeline {
namespace {

double bump(double z, double centre, double width) {
    const double t = (z - centre) / width;
    return std::exp(-t * t);
}

struct Section {  // half-axes and centre, mm
    double a, b, c;
};

Section section(double z, double depth, double belly_mm) {
    return {150 + 14 * bump(z, 150, 90) + 10 * bump(z, -150, 70) - 4 * bump(z, 10, 50) - depth,
            100 + 6 * bump(z, 140, 80) + belly_mm * bump(z, -40, 70) - depth,
            0.5 * belly_mm * bump(z, -40, 70) + 3 * bump(z, 120, 60)};
}

}  // namespace

double trunk(Point3 p, double depth_mm, double belly_mm) {
    const Section s = section(p.z, depth_mm, belly_mm);
    const double y = (p.y - s.c) / s.b;
    return std::pow(std::abs(p.x / s.a), 2.3) + std::pow(std::abs(y), y > 0 ? 2.0 : 2.8) - 1;
}

Point3 trunk_point(double theta, double z, double depth_mm, double belly_mm) {
    const double c = section(z, depth_mm, belly_mm).c;
    double low = 0, high = 400;  // of the radius
    for (int i = 0; i < 60; ++i) {
        const double r = 0.5 * (low + high);
        const Point3 p{r * std::cos(theta), c + r * std::sin(theta), z};
        (trunk(p, depth_mm, belly_mm) < 0 ? low : high) = r;
    }
    return {low * std::cos(theta), c + low * std::sin(theta), z};
}

}  // namespace sonocase::pipeline
