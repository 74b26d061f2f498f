// SPDX-License-Identifier: Apache-2.0

// A ball as exact anatomy, at rest or breathing, and needle poses for it.
#pragma once

#include <cmath>

#include "formats/base/constants.h"
#include "formats/scoring/anatomy.h"

namespace sonocase::testing {

// Label 1 inside, 2 in a smaller ball to be spared.
class Ball final : public Anatomy {
  public:
    Ball(Point3 centre, double radius, Point3 vessel = {1e9, 0, 0}, double vessel_radius = 0)
        : centre_(centre), vessel_(vessel), radius_(radius), vessel_radius_(vessel_radius) {}
    bool inside(Point3 p) const override { return distance(p, centre_) < radius_; }
    int label(Point3 p) const override {
        return !inside(p) ? 0 : distance(p, vessel_) < vessel_radius_ ? 2 : 1;
    }
    double exit_distance(Point3 from, Vector3 direction, double reach) const override {
        const Vector3 v = from - centre_;
        const double b = dot(v, direction), c = dot(v, v) - radius_ * radius_;
        return std::min(reach, -b + std::sqrt(std::max(b * b - c, 0.0)));
    }

  private:
    Point3 centre_, vessel_;
    double radius_, vessel_radius_;
};

// The same ball, whose inside is shifted by weight(p) * swing(t): the weight is affine in p, so
// both directions have closed forms.
class BreathingBall final : public Anatomy {
  public:
    struct Motion {
        Vector3 amplitude_mm, slope_per_mm;  // slope: of the weight, which is 0.7 at `middle`
        Point3 middle;
        double period_s = 4;
        Vector3 swing(double time_s) const {
            return std::sin(2 * kPi * time_s / period_s) * amplitude_mm;
        }
    };
    BreathingBall(const Ball& still, const Motion& motion) : still_(still), motion_(motion) {}
    bool inside(Point3 p) const override { return still_.inside(p); }
    int label(Point3 p) const override { return still_.label(p); }
    double exit_distance(Point3 from, Vector3 direction, double reach) const override {
        return still_.exit_distance(from, direction, reach);
    }
    using Anatomy::at_rest;
    Vector3 breath_mm(double time_s) const override { return motion_.swing(time_s); }
    Point3 at_rest(Point3 p, Vector3 breath_mm) const override { return p - weight(p) * breath_mm; }
    Point3 moved(Point3 rest, double time_s) const override {
        const Vector3 s = motion_.swing(time_s);
        return rest + (weight(rest) / (1 - dot(motion_.slope_per_mm, s))) * s;
    }
    // In a region of a metre, with slopes of a thousandth.
    double greatest_shift_mm() const override { return 3 * norm(motion_.amplitude_mm); }

  private:
    double weight(Point3 p) const { return 0.7 + dot(motion_.slope_per_mm, p - motion_.middle); }
    Ball still_;
    Motion motion_;
};

// Needle with its tip at `tip`, pointing along `direction`.
inline Rigid needle_at(Point3 tip, Vector3 direction) {
    const Vector3 z = normalized(direction), x = any_perpendicular(z);
    return {Matrix3::from_columns(x, cross(z, x), z), tip - Point3{}};
}

}  // namespace sonocase::testing
