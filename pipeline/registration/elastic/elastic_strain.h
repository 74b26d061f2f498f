// SPDX-License-Identifier: Apache-2.0

// The strain energy of a hyperelastic body at the samples of a spline lattice, and its Gauss-Newton
// model.
//
//     W(F) = mu |F - R|^2 + kappa (log det F)^2 + beta (log(det F / d0))^2 if det F < d0
//
// F  slopes of the whole map, dq/dx + grad d;  R  its polar rotation: turning costs nothing
// Gradient, with R fixed and K = cof F:
//     2 mu (F - R) + 2 (kappa log det + beta [det < d0] log(det / d0)) / det K
// Curvature along dF, always positive:
//     2 mu dF + 2 (kappa + beta [det < d0]) / det^2 (K : dF) K
// Halves of both are kept here, and of all other terms of the sum.
#pragma once

#include <vector>

#include "pipeline/registration/elastic/spline_lattice.h"
#include "pipeline/registration/elastic/tissue_lattice.h"
#include "pipeline/registration/map/registration.h"

namespace sonocase::pipeline::inline registration_elastic {

// The natural logarithm with the same bits on every platform; those of libm differ.
// x > 0, finite, not subnormal. Relative error below 4e-16 away from 1, absolute below 1e-16 near
// it.
double natural_log(double x);

struct StrainOptions {
    double stiffness = 1;  // of all tissues
    double barrier = 30;   // beta, mm^2
    double barrier_det = 0.6;
};

class ElasticStrain {
  public:
    // quadratic  the map that the displacement is added to
    ElasticStrain(const SplineLattice& lattice,
                  const QuadraticMap& quadratic,
                  TissueLattice tissue);

    struct Value {
        double energy_mm2 = 0;
        double min_det = 0;
    };
    // At slopes `at` plus `step` times `along`.
    Value value(const LatticeSlopes& at,
                const LatticeSlopes& along,
                double step,
                const StrainOptions& options) const;

    // Gradient and curvature at `at`; the gradient's transpose goes to `gradient`.
    void linearise(const LatticeSlopes& at, const StrainOptions& options, LatticeSlopes* gradient);
    // In place: slopes of a step to the curvature times them.
    void apply_curvature(LatticeSlopes* slopes) const;
    // What apply_curvature multiplies each slope by, cross terms left out.
    void diagonal(LatticeSlopes* out) const;

  private:
    struct Columns {
        Lanes x, y, z;  // of a 3 x 3 matrix
    };
    const SplineLattice& lattice_;
    TissueLattice tissue_;
    std::vector<Columns> base_;      // dq/dx
    std::vector<Columns> cofactor_;  // scaled by the root of its curvature
    std::vector<float> shape_;       // curvature of the shape term
};

}  // namespace sonocase::pipeline::inline registration_elastic
