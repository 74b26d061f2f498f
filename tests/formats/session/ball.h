// A ball as anatomy, exact, and needle poses to put into it.
#pragma once

#include <cmath>

#include "formats/session/anatomy.h"

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

// Needle with its tip at `tip`, pointing along `direction`.
inline Rigid needle_at(Point3 tip, Vector3 direction) {
    const Vector3 z = normalized(direction), x = any_perpendicular(z);
    return {Matrix3::from_columns(x, cross(z, x), z), tip - Point3{}};
}

}  // namespace sonocase::testing
