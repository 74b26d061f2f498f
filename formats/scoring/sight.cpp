// SPDX-License-Identifier: Apache-2.0

#include "formats/scoring/sight.h"

#include <algorithm>
#include <cmath>

#include "formats/base/portable_math.h"

namespace sonocase {
namespace {

double radius_of(const Probe& probe) {
    return probe.shape == ProbeShape::curvilinear ? probe.radius_mm : 0;
}

}  // namespace

bool in_image(const Probe& probe, double x, double z) {
    if (probe.shape == ProbeShape::linear) {
        return std::abs(x) <= 0.5 * probe.width_mm && z >= 0 && z <= probe.depth_mm;
    }
    const double radius = radius_of(probe);
    const double r = hypotenuse(x, z + radius);
    return r >= radius && r <= radius + probe.depth_mm &&
           std::abs(arc_tangent(x, z + radius)) <= 0.5 * probe.field_of_view_rad;
}

double distance_to_image(const Probe& probe, double x, double z) {
    if (probe.shape == ProbeShape::linear) {
        const double dx = std::max(std::abs(x) - 0.5 * probe.width_mm, 0.0);
        const double dz = std::max({-z, z - probe.depth_mm, 0.0});
        return hypotenuse(dx, dz);
    }
    const double radius = radius_of(probe), outer = radius + probe.depth_mm;
    const double half = 0.5 * probe.field_of_view_rad;
    const double u = std::abs(x), w = z + radius;  // the region is the same on both sides
    const double r = hypotenuse(u, w);
    if (arc_tangent(u, w) <= half) return std::max({radius - r, r - outer, 0.0});
    // Beside the fan: its straight edge runs from the inner arc to the outer.
    const double along =
        std::clamp(u * sonocase::sine(half) + w * sonocase::cosine(half), radius, outer);
    return hypotenuse(u - along * sonocase::sine(half), w - along * sonocase::cosine(half));
}

ImageInterval interval_in_image(const Probe& probe, Point3 a, Point3 b, double half_slab_mm) {
    const Vector3 d = b - a;
    if (!(norm(d) > 0)) return {};
    double low = 0, high = 1;
    // Keeps the part where offset + t * slope <= 0.
    const auto clip = [&](double offset, double slope) {
        if (slope > 0) high = std::min(high, -offset / slope);
        if (slope < 0) low = std::max(low, -offset / slope);
        if (slope == 0 && offset > 0) high = -1;
    };
    clip(a.y - half_slab_mm, d.y);
    clip(-a.y - half_slab_mm, -d.y);
    if (probe.shape == ProbeShape::linear) {
        clip(a.x - 0.5 * probe.width_mm, d.x);
        clip(-a.x - 0.5 * probe.width_mm, -d.x);
        clip(-a.z, -d.z);
        clip(a.z - probe.depth_mm, d.z);
        return {low, high};
    }
    const double radius = radius_of(probe), outer = radius + probe.depth_mm;
    const double sine = sonocase::sine(0.5 * probe.field_of_view_rad);
    const double cosine = sonocase::cosine(0.5 * probe.field_of_view_rad);
    const double w = a.z + radius;
    clip(a.x * cosine - w * sine, d.x * cosine - d.z * sine);
    clip(-a.x * cosine - w * sine, -d.x * cosine - d.z * sine);
    // The face's chord keeps out what lies behind the probe.
    clip(radius * cosine - w, -d.z);
    const double qa = d.x * d.x + d.z * d.z, qb = a.x * d.x + w * d.z,
                 qc = a.x * a.x + w * w - outer * outer;
    if (qa == 0) return qc <= 0 ? ImageInterval{low, high} : ImageInterval{};
    const double root = qb * qb - qa * qc;
    if (!(root > 0)) return {};
    low = std::max(low, (-qb - std::sqrt(root)) / qa);
    high = std::min(high, (-qb + std::sqrt(root)) / qa);
    return {low, high};
}

double length_in_image(const Probe& probe, Point3 a, Point3 b, double half_slab_mm) {
    return interval_in_image(probe, a, b, half_slab_mm).share() * norm(b - a);
}

bool sound_reaches(const Anatomy& anatomy,
                   const Probe& probe,
                   const Rigid& mannequin_from_probe,
                   Point3 p_probe,
                   double time_s) {
    if (!anatomy.knows_tissue()) return true;
    // The point of the face where the scan line begins, and the way from there.
    Point3 face{p_probe.x, p_probe.y, 0};
    if (probe.shape != ProbeShape::linear) {
        const double radius = radius_of(probe);
        const Vector3 from_apex{p_probe.x, 0, p_probe.z + radius};
        const double r = std::sqrt(dot(from_apex, from_apex));
        if (!(r > radius)) return true;
        const Vector3 out = from_apex / r;
        face = {radius * out.x, p_probe.y, radius * out.z - radius};
    }
    const Vector3 way = p_probe - face;
    const double length = norm(way);
    if (!(length > 0)) return true;
    const Point3 start = mannequin_from_probe * face;
    const Vector3 along = mannequin_from_probe.rotation * (way / length);
    double air_mm = 0;
    for (double s = 0.5 * kSightStepMm; s < length; s += kSightStepMm) {
        const Point3 p = start + s * along;
        const int label = anatomy.label(anatomy.at_rest(p, time_s));
        if (label == 0) air_mm += kSightStepMm;
        if (air_mm > kCoupledAirMm || anatomy.blocks_sound(label)) return false;
    }
    return true;
}

double visible_length(const Anatomy& anatomy,
                      const Probe& probe,
                      const Rigid& mannequin_from_probe,
                      Point3 a,
                      Point3 b,
                      double half_slab_mm,
                      double time_s) {
    const ImageInterval part = interval_in_image(probe, a, b, half_slab_mm);
    const double length = part.share() * norm(b - a);
    if (!(length > 0) || !anatomy.knows_tissue()) return length;
    const int points = std::max(1, static_cast<int>(std::ceil(length / kSightShaftMm)));
    int seen = 0;
    for (int i = 0; i < points; ++i) {
        const double at = part.low + (part.high - part.low) * (i + 0.5) / points;
        if (sound_reaches(anatomy, probe, mannequin_from_probe, a + at * (b - a), time_s)) ++seen;
    }
    return length * seen / points;
}

}  // namespace sonocase
