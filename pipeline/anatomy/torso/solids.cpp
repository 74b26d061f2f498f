// SPDX-License-Identifier: Apache-2.0

#include "pipeline/anatomy/torso/solids.h"

#include <algorithm>
#include <cmath>

#include "pipeline/anatomy/torso/trunk.h"

namespace sonocase::pipeline {
namespace {

double capsule_distance(Point3 p, Point3 a, Point3 b) {
    const Vector3 ab = b - a;
    const double t = std::clamp(dot(p - a, ab) / dot(ab, ab), 0.0, 1.0);
    return distance(p, a + t * ab);
}

double tube_distance(const Tube& tube, Point3 p) {
    double best = INFINITY;
    for (std::size_t i = 0; i + 1 < tube.path.size(); ++i) {
        best = std::min(best, capsule_distance(p, tube.path[i], tube.path[i + 1]));
    }
    return best - tube.radius;
}

double ellipsoid_value(const Ellipsoid& e, Point3 p) {
    const Vector3 q = e.local_from_ct * (p - e.centre);
    return (q.x / e.axes.x) * (q.x / e.axes.x) + (q.y / e.axes.y) * (q.y / e.axes.y) +
           (q.z / e.axes.z) * (q.z / e.axes.z) - 1;
}

// Distance from p to the zero set of a smooth implicit function f, by foot-point iteration: onto
// the surface along the gradient, then along the surface towards p, until neither step moves the
// foot. The sign is that of f(p).
template <class F>
double implicit_distance(const F& f, Point3 p) {
    const auto gradient = [&](Point3 x) {
        constexpr double h = 1e-4;
        return Vector3{f({x.x + h, x.y, x.z}) - f({x.x - h, x.y, x.z}),
                       f({x.x, x.y + h, x.z}) - f({x.x, x.y - h, x.z}),
                       f({x.x, x.y, x.z + h}) - f({x.x, x.y, x.z - h})} /
               (2 * h);
    };
    Point3 foot = p;
    double best = INFINITY;
    for (int i = 0; i < 400; ++i) {
        for (int k = 0; k < 20; ++k) {
            const Vector3 g = gradient(foot);
            const double step = f(foot) / std::max(dot(g, g), 1e-12);
            // At most 20 mm per step: deep inside an ellipsoid the gradient vanishes and the step
            // grows without bound.
            const Vector3 move = step * g;
            const double length = norm(move);
            foot = foot - (length > 20 ? 20 / length : 1.0) * move;
            if (length < 1e-10) break;
        }
        const Vector3 n = normalized(gradient(foot));
        const Vector3 to_p = p - foot;
        const Vector3 along = to_p - dot(to_p, n) * n;
        best = std::min(best, norm(to_p));
        if (norm(along) < 1e-9) break;
        foot = foot + 0.6 * along;
    }
    return f(p) < 0 ? -best : best;
}

}  // namespace

bool inside(const Solid& solid, Point3 p, double belly_mm) {
    if (!solid.box.contains(p)) return false;
    if (const auto* e = std::get_if<Ellipsoid>(&solid.shape)) {
        if (ellipsoid_value(*e, p) >= 0) return false;
    } else if (const auto* tube = std::get_if<Tube>(&solid.shape)) {
        if (tube_distance(*tube, p) >= 0) return false;
    } else {
        return trunk(p, std::get<Layer>(solid.shape).depth, belly_mm) < 0;
    }
    return solid.within_depth < 0 || trunk(p, solid.within_depth, belly_mm) < 0;
}

double solid_distance(const Solid& solid, Point3 p, double belly_mm, double reach_mm) {
    Vector3 gap;
    for (int a = 0; a < 3; ++a) {
        gap[a] = std::max({solid.box.lower[a] - p[a], p[a] - solid.box.upper[a], 0.0});
    }
    if (norm(gap) > reach_mm) return norm(gap);
    const auto layer = [&](double depth) {
        // A layer one millimetre deeper is more than half a millimetre away.
        if (trunk(p, depth + 2 * reach_mm, belly_mm) < 0) return -reach_mm;
        if (trunk(p, depth - 2 * reach_mm, belly_mm) > 0) return reach_mm;
        return implicit_distance([&](Point3 x) { return trunk(x, depth, belly_mm); }, p);
    };
    double d;
    if (const auto* e = std::get_if<Ellipsoid>(&solid.shape)) {
        // The ellipsoid through p is a scaled copy; the two are closest along the shortest axis.
        const double least = (std::sqrt(ellipsoid_value(*e, p) + 1) - 1) *
                             std::min({e->axes.x, e->axes.y, e->axes.z});
        if (std::abs(least) > reach_mm) {
            d = least;
        } else {
            d = implicit_distance([&](Point3 x) { return ellipsoid_value(*e, x); }, p);
        }
    } else if (const auto* tube = std::get_if<Tube>(&solid.shape)) {
        d = tube_distance(*tube, p);
    } else {
        return layer(std::get<Layer>(solid.shape).depth);
    }
    return solid.within_depth < 0 || d > reach_mm ? d : std::max(d, layer(solid.within_depth));
}

}  // namespace sonocase::pipeline
