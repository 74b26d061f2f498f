// SPDX-License-Identifier: Apache-2.0

// How much of the scan plane's thickness the needle fills at a point of the plane.
//
// The needle is a cylinder of radius rho that ends at the tip; the plane is a slab |y| <= t / 2. At
// (x, 0, z) the share is the length of the segment {(x, y, z), |y| <= t / 2} inside the cylinder,
// over t: the partial volume of [Magee], "Needle Rendering". With w(y) = (x, y, z) - tip and the
// unit axis a,
//     |w - (w.a) a|^2 <= rho^2   is a quadratic in y,   -length <= w.a <= 0   an interval.
// All in the probe frame, mm. Constant time.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>

#include "formats/base/geometry.h"
#include "formats/exercise/exercise.h"
#include "runtime/imaging/core/scan_geometry.h"

namespace sonocase::runtime {

inline constexpr double kTipReachMm = 40;  // model paper: from tip to shaft opacity, linearly

struct NeedleShape {
    Point3 tip;    // probe frame
    Vector3 axis;  // unit, hub to tip
    double radius_mm = 0.5;
    double length_mm = 150;
    double slab_mm = 1;  // t; 0 is treated as a thin slab of kMinSlabMm
    double tip_opacity = 1, shaft_opacity = 1;
    Vector3 bevel{0, 0, -1};  // unit: the side that the bevel faces
    const NeedleMake* make = &needle_makes().front();
    double echo = 1, tail = 1;  // model physical: amplitudes over those of a needle
};

inline constexpr double kMinSlabMm = 1e-3;

// bevel_probe: zero where it faces the probe.
inline NeedleShape needle_shape(const NeedleModel& model,
                                Point3 tip_probe,
                                Vector3 axis_probe,
                                Vector3 bevel_probe = {}) {
    const double diameter = needle_diameter_mm(model);
    return {.tip = tip_probe,
            .axis = axis_probe,
            .radius_mm = 0.5 * diameter,
            .length_mm = model.length_mm,
            .slab_mm = std::max(model.slab_mm > 0 ? model.slab_mm : diameter, kMinSlabMm),
            .tip_opacity = model.tip_visibility,
            .shaft_opacity = model.shaft_visibility,
            .bevel = norm(bevel_probe) > 0.5 ? bevel_probe : Vector3{0, 0, -1},
            .make = model.make};
}

// Share in [0, 1]; `along` receives the distance from the tip back along the shaft, mm, >= 0.
inline double needle_share(const NeedleShape& n, double x, double z, double& along) {
    const double wx = x - n.tip.x, wy = -n.tip.y, wz = z - n.tip.z;
    const double u0 = wx * n.axis.x + wy * n.axis.y + wz * n.axis.z;
    double low = -0.5 * n.slab_mm, high = 0.5 * n.slab_mm;
    const double a = 1 - n.axis.y * n.axis.y;
    const double b = wy - u0 * n.axis.y;
    const double c = wx * wx + wy * wy + wz * wz - u0 * u0 - n.radius_mm * n.radius_mm;
    along = std::max(-u0, 0.0);
    if (a > 1e-6) {
        const double disc = b * b - a * c;
        if (disc <= 0) return 0;
        const double root = std::sqrt(disc);
        low = std::max(low, (-b - root) / a);
        high = std::min(high, (-b + root) / a);
    } else if (c > 0) {
        return 0;
    }
    if (std::abs(n.axis.y) > 1e-6) {
        const double y0 = (-n.length_mm - u0) / n.axis.y, y1 = -u0 / n.axis.y;
        low = std::max(low, std::min(y0, y1));
        high = std::min(high, std::max(y0, y1));
    } else if (u0 > 0 || u0 < -n.length_mm) {
        return 0;
    }
    return std::max(high - low, 0.0) / n.slab_mm;
}

inline constexpr int kBeamBlock = 16;  // beams that are processed together; a cache line of floats

// A needle prepared for a block of beams, in single precision: the beams relative to the needle's
// tip, and the constants of needle_share().
struct NeedleRow {
    alignas(64) float origin_x[kBeamBlock];
    alignas(64) float origin_z[kBeamBlock];
    alignas(64) float direction_x[kBeamBlock];
    alignas(64) float direction_z[kBeamBlock];
    float step, wy, ax, ay, az, a, radius, length, slab, tip_opacity, shaft_opacity, inverse_reach;
    // Model physical.
    float bevel_x, bevel_z, rough, inverse_lobe2, tip_middle, tip_swing, echo, tail;
};

// The part of the needle that the slab can show, projected on the plane: a segment with a radius.
class NeedleStrip {
  public:
    NeedleStrip() = default;
    explicit NeedleStrip(const NeedleShape& n, double extra_mm = 0)
        : radius_(n.radius_mm + extra_mm) {
        const double reach = 0.5 * n.slab_mm + n.radius_mm;
        double u0 = -n.length_mm, u1 = 0;  // along the axis, 0 at the tip
        if (std::abs(n.axis.y) > 1e-9) {
            const double a = (-reach - n.tip.y) / n.axis.y, b = (reach - n.tip.y) / n.axis.y;
            u0 = std::max(u0, std::min(a, b));
            u1 = std::min(u1, std::max(a, b));
        } else if (std::abs(n.tip.y) > reach) {
            u1 = u0 - 1;
        }
        near_ = u0 <= u1;
        if (!near_) return;
        origin_ = {n.tip.x + u0 * n.axis.x, n.tip.z + u0 * n.axis.z};
        const double dx = (u1 - u0) * n.axis.x, dz = (u1 - u0) * n.axis.z;
        length_ = std::hypot(dx, dz);
        if (length_ > 1e-9) direction_ = {dx / length_, dz / length_};
    }

    // Samples [k0, k1) of a beam that can show the needle; false if none.
    bool range(const ScanGeometry& g, int line, int& k0, int& k1) const {
        if (!near_) return false;
        const auto& [o, d] = g.beams[line];
        const double ox = o.x - origin_.x, oz = o.z - origin_.z;
        double r0 = 0, r1 = g.depth_mm;
        const auto clip = [&](double at0, double slope, double low, double high) {
            if (std::abs(slope) < 1e-12) {
                if (at0 < low || at0 > high) r1 = r0 - 1;
                return;
            }
            const double a = (low - at0) / slope, b = (high - at0) / slope;
            r0 = std::max(r0, std::min(a, b));
            r1 = std::min(r1, std::max(a, b));
        };
        clip(oz * direction_.x - ox * direction_.z, d.z * direction_.x - d.x * direction_.z,
             -radius_, radius_);
        clip(ox * direction_.x + oz * direction_.z, d.x * direction_.x + d.z * direction_.z,
             -radius_, length_ + radius_);
        if (r1 < r0) return false;
        k0 = std::max(0, static_cast<int>(r0 / g.step_mm - 0.5) - 1);
        k1 = std::min(g.samples, static_cast<int>(r1 / g.step_mm - 0.5) + 3);
        return k0 < k1;
    }

    // Prepares the needle for the beams from `line` on and gives the samples [k0, k1) that can show
    // it; whole: all samples. False if there are none.
    bool prepare_block(const NeedleShape& n,
                       const ScanGeometry& g,
                       int line,
                       bool whole,
                       NeedleRow& row,
                       int& k0,
                       int& k1) const {
        k0 = g.samples;
        k1 = 0;
        for (int v = 0; v < kBeamBlock; ++v) {
            int a = 0, b = 0;
            if (!range(g, std::min(line + v, g.scanlines - 1), a, b)) continue;
            k0 = std::min(k0, a);
            k1 = std::max(k1, b);
        }
        if (whole) {
            k0 = 0;
            k1 = g.samples;
        }
        if (k0 >= k1) return false;
        for (int v = 0; v < kBeamBlock; ++v) {
            const int l = std::min(line + v, g.scanlines - 1);
            const auto& [o, d] = g.beams[l];
            row.origin_x[v] = static_cast<float>(o.x - n.tip.x);
            row.origin_z[v] = static_cast<float>(o.z - n.tip.z);
            row.direction_x[v] = static_cast<float>(d.x);
            row.direction_z[v] = static_cast<float>(d.z);
        }
        row.step = static_cast<float>(g.step_mm);
        row.wy = static_cast<float>(-n.tip.y);
        row.ax = static_cast<float>(n.axis.x);
        row.ay = static_cast<float>(n.axis.y);
        row.az = static_cast<float>(n.axis.z);
        row.a = static_cast<float>(1 - n.axis.y * n.axis.y);
        row.radius = static_cast<float>(n.radius_mm);
        row.length = static_cast<float>(n.length_mm);
        row.slab = static_cast<float>(n.slab_mm);
        row.tip_opacity = static_cast<float>(n.tip_opacity);
        row.shaft_opacity = static_cast<float>(n.shaft_opacity);
        row.inverse_reach = static_cast<float>(1 / kTipReachMm);
        const NeedleMake& make = *n.make;
        row.bevel_x = static_cast<float>(n.bevel.x);
        row.bevel_z = static_cast<float>(n.bevel.z);
        row.rough = static_cast<float>(make.rough);
        row.inverse_lobe2 = static_cast<float>(1 / (make.lobe_sin * make.lobe_sin));
        row.tip_middle = static_cast<float>(0.5 * (make.tip_towards + make.tip_away));
        row.echo = static_cast<float>(n.echo);
        row.tail = static_cast<float>(n.tail);
        row.tip_swing = static_cast<float>(0.5 * (make.tip_towards - make.tip_away));
        return true;
    }

  private:
    bool near_ = false;
    PlanePoint origin_, direction_{1, 0};
    double length_ = 0, radius_ = 0;
};

}  // namespace sonocase::runtime
