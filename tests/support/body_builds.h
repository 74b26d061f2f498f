// SPDX-License-Identifier: Apache-2.0

// Mannequins of another build than the patient's: a surface fattened, widened or slimmed by a known
// smooth displacement, and sweeps of it with noise and outliers.
#pragma once

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "formats/volume/surface.h"
#include "support/area_sampler.h"
#include "support/random.h"

namespace sonocase::testing {

enum class Build { belly, wide, slim, pear, gaunt, huge, pregnant };

inline std::string build_name(Build build) {
    switch (build) {
        case Build::belly: return "belly";
        case Build::wide: return "wide";
        case Build::slim: return "slim";
        case Build::pear: return "pear";
        case Build::gaunt: return "gaunt";
        case Build::pregnant: return "pregnant";
        default: return "huge";
    }
}

// Directions of a body in the frame of its surface.
struct BodyAxes {
    Point3 centre;
    Vector3 left, front, head;  // unit
};

// Outward displacement of the skin, mm: at most 45 (belly), 30 (wide), -25 (slim), 40 (pear), -50
// (gaunt), 90 (huge), 75 (pregnant). sine, cosine: of the direction from the axis, 1 and 0 at the
// front.
inline double build_offset_mm(
    Build build, double sine, double cosine, double height_mm, double shift_mm) {
    const double front = std::max(0.0, sine), side2 = cosine * cosine;
    const auto bump = [&](double at, double width) {
        const double t = (height_mm - at - shift_mm) / width;
        return std::exp(-0.5 * t * t);
    };
    switch (build) {
        case Build::belly: return 45 * bump(-20, 80) * front * front;
        case Build::wide: return 15 + 15 * side2 * bump(-20, 150);
        case Build::slim: return -25 * (0.55 + 0.45 * bump(0, 110)) * (0.75 + 0.25 * side2);
        case Build::pear: return 40 * bump(-130, 75) * (0.55 + 0.45 * side2) - 8 * bump(90, 80);
        case Build::gaunt: return -50 * bump(-10, 75) * front * front - 14 * side2 - 4;
        case Build::pregnant: return 75 * bump(-40, 65) * front * front * front;
        default: return 45 + 45 * bump(-20, 110) * (0.4 + 0.6 * front);
    }
}

inline Surface built_surface(const Surface& surface,
                             const BodyAxes& axes,
                             Build build,
                             std::uint64_t seed) {
    Random random(seed);
    const double amplitude = random.uniform(0.88, 1), shift = random.uniform(-20, 20),
                 lean = random.uniform(-0.12, 0.12);
    Surface out = surface;
    out.normals.clear();
    for (Point3& p : out.points) {
        const Vector3 d = p - axes.centre;
        const double u = dot(d, axes.left), v = dot(d, axes.front), w = dot(d, axes.head);
        const double r = std::max(1e-6, std::hypot(u, v));
        const double offset =
            amplitude * (1 + lean * u / r) * build_offset_mm(build, v / r, u / r, w, shift);
        p = p + offset * ((u / r) * axes.left + (v / r) * axes.front);
    }
    return out;
}

struct BuildSweep {
    int points = 2000;
    double noise_mm = 1;      // per axis
    double outliers = 0.01;   // share of readings 10 to 60 mm off the skin
    double least_front = -2;  // sine of the direction below which nothing is read; -0.3: no back
};

inline BuildSweep usual_sweep(Build build) {
    BuildSweep sweep;
    if (build == Build::slim || build == Build::pear || build == Build::gaunt)
        sweep.least_front = -0.3;
    return sweep;
}

// Readings spread evenly over the area. axes: of the surface.
inline Surface sweep_of_build(const Surface& surface,
                              const BodyAxes& axes,
                              const BuildSweep& plan,
                              Random& random) {
    const AreaSampler sampler(surface);
    Surface readings;
    while (static_cast<int>(readings.points.size()) < plan.points) {
        const auto [p, normal, corner] = sampler.draw(random);
        const Vector3 d = p - axes.centre;
        const double side = dot(d, axes.left), front = dot(d, axes.front);
        if (front < plan.least_front * std::hypot(side, front)) continue;
        Point3 y =
            p + plan.noise_mm * Vector3{random.gaussian(), random.gaussian(), random.gaussian()};
        if (random.uniform(0, 1) < plan.outliers)
            y = y + random.uniform(10, 60) * normalized(normal);
        readings.points.push_back(y);
    }
    return readings;
}

}  // namespace sonocase::testing
