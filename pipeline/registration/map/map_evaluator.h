// SPDX-License-Identifier: Apache-2.0

// Value and Jacobian of a fitted map in one fast evaluation: the quadratic in double, the residual
// spline in four-lane single precision (its values are a few cm, so that its rounding stays below
// 1e-5 mm). Coordinates are relative to a centre on each side, which keeps them small whatever the
// frames are.
#pragma once

#include <vector>

#include "pipeline/registration/map/registration.h"

namespace sonocase::pipeline::inline registration_map {

struct MapSample {
    Vector3 value;     // mannequin, relative to the mannequin centre, mm
    Matrix3 jacobian;  // d(mannequin)/d(ct)
};

class MapEvaluator {
  public:
    explicit MapEvaluator(const Registration& registration);

    Point3 ct_centre() const { return ct_centre_; }
    Point3 mannequin_centre() const { return mannequin_centre_; }
    // ct  relative to ct_centre(), mm
    MapSample operator()(Vector3 ct) const;

  private:
    typedef float Lanes __attribute__((vector_size(16)));

    void add_residual(Vector3 ct, MapSample* sample) const;

    Point3 ct_centre_, mannequin_centre_;
    double coefficients_[3][10];  // of u = ct / scale, constant term relative to the centre
    double scale_ = 1;
    Int3 size_{0, 0, 0};
    Vector3 origin_;  // of the spline's cells, relative to ct_centre
    double spacing_ = 1;
    std::vector<Lanes> control_;
};

}  // namespace sonocase::pipeline::inline registration_map
