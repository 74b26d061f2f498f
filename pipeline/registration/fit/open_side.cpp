// SPDX-License-Identifier: Apache-2.0

#include "pipeline/registration/fit/open_side.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "pipeline/registration/fit/matching.h"

namespace sonocase::pipeline::inline registration_fit {

namespace {

constexpr double kFullWeightMm2 = 300, kNoOpening = 0.15, kFullOpening = 0.35;

// The middle nine tenths of the readings along a direction.
double extent_along(const TargetSurface& t,
                    const std::vector<std::uint32_t>& readings,
                    Vector3 direction) {
    std::vector<double> along;
    for (const std::uint32_t i : readings) along.push_back(dot(direction, t.points[i] - Point3{}));
    if (along.size() < 2) return 0;
    std::sort(along.begin(), along.end());
    return along[along.size() - 1 - along.size() / 20] - along[along.size() / 20];
}

// The centre, in coordinates along u and v, of the circle through the readings by least squares of
// |p - c|^2 - r^2 (Kasa). The centroid of half a body lies off its axis; the centre of its circle
// does not.
std::array<double, 2> circle_centre(const TargetSurface& t,
                                    const std::vector<std::uint32_t>& readings,
                                    Vector3 u,
                                    Vector3 v) {
    const auto count = static_cast<double>(readings.size());
    double mean_x = 0, mean_y = 0;
    for (const std::uint32_t i : readings) {
        mean_x += dot(u, t.points[i] - Point3{}) / count;
        mean_y += dot(v, t.points[i] - Point3{}) / count;
    }
    double xx = 0, xy = 0, yy = 0, xq = 0, yq = 0;
    for (const std::uint32_t i : readings) {
        const double x = dot(u, t.points[i] - Point3{}) - mean_x,
                     y = dot(v, t.points[i] - Point3{}) - mean_y, q = x * x + y * y;
        xx += x * x;
        xy += x * y;
        yy += y * y;
        xq += x * q;
        yq += y * q;
    }
    const double det = xx * yy - xy * xy;
    if (!(det > 1e-9 * xx * yy)) return {mean_x, mean_y};
    return {mean_x + 0.5 * (xq * yy - yq * xy) / det, mean_y + 0.5 * (yq * xx - xq * xy) / det};
}

Vector3 mean_normal(const TargetSurface& t, const std::vector<std::uint32_t>& readings) {
    Vector3 sum;
    for (const std::uint32_t i : readings) sum = sum + t.normals[i];
    return sum / std::max(1.0, static_cast<double>(readings.size()));
}

}  // namespace

double OpenSide::weight_mm2() const {
    if (!open()) return 0;
    return kFullWeightMm2 * std::clamp((size - kNoOpening) / (kFullOpening - kNoOpening), 0.0, 1.0);
}

OpenSide open_towards(Vector3 direction) {
    OpenSide side;
    side.size = 1;
    side.direction = direction;
    side.flatness = INFINITY;
    return side;
}

OpenSide find_open_side(const TargetSurface& target, const std::optional<Vector3>& head) {
    // One reading per cube: strokes that were repeated count once.
    std::vector<std::uint32_t> readings = thin_target(target, 1.2 * target.spacing_mm);
    // Normals at the rim are those of one-sided neighbourhoods, and fewer.
    OpenSide side;
    if (readings.empty()) return side;
    Vector3 m;
    if (head) {
        const Vector3 axis = normalized(*head), u = any_perpendicular(axis), v = cross(axis, u);
        const auto centre = circle_centre(target, readings, u, v);
        for (const std::uint32_t i : readings) {
            const Vector3 p = target.points[i] - Point3{}, n = target.normals[i];
            const double out =
                (dot(u, p) - centre[0]) * dot(u, n) + (dot(v, p) - centre[1]) * dot(v, n);
            m = m + (out < 0 ? -1.0 : 1.0) * n;
        }
        m = m / static_cast<double>(readings.size());
        m = m - dot(m, axis) * axis;
    } else {
        m = mean_normal(target, readings);
    }
    side.size = norm(m);
    if (!(side.size > 1e-9)) return side;
    side.direction = -normalized(m);
    // Across: at right angles to the hole, and to the head where that is known; otherwise the
    // narrower of the two directions, because a torso is at least as tall as it is wide.
    const Vector3 u =
        head ? normalized(cross(*head, side.direction)) : any_perpendicular(side.direction);
    double across = extent_along(target, readings, u);
    if (!head) {
        for (int n = 1; n < 12; ++n) {
            const Vector3 turned =
                rotation_about(side.direction, n * 0.2617993877991494) * u;  // 15 degrees
            across = std::min(across, extent_along(target, readings, turned));
        }
    }
    side.flatness = across / std::max(1.0, extent_along(target, readings, side.direction));
    return side;
}

}  // namespace sonocase::pipeline::inline registration_fit
