// SPDX-License-Identifier: Apache-2.0

#include "formats/scoring/sight.h"

#include <algorithm>
#include <cmath>

#include "formats/scoring/image_region.h"

namespace sonocase {

bool sound_reaches(const Anatomy& anatomy,
                   const Probe& probe,
                   const Rigid& mannequin_from_probe,
                   Point3 p_probe,
                   double time_s) {
    if (!anatomy.knows_tissue()) return true;
    // The face's point of the scanline, and the way from there.
    Point3 face{p_probe.x, p_probe.y, 0};
    if (probe.shape != ProbeShape::linear) {
        const double radius = probe.shape == ProbeShape::curvilinear ? probe.radius_mm : 0;
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
