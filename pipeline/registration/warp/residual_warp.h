// SPDX-License-Identifier: Apache-2.0

// What the quadratic leaves at the skin: a smooth displacement in a cubic B-spline, added and not
// composed, so that the proof of det J > 0.2 stays exact.
//
// Minimises, with every cost in mm^2 beside the mean squared gap at the skin,
//     bending  lb 50^4 mean |Hessian d|^2  +  stretching  lm 50^2 mean |grad d|^2
//     + depth  mu mean min(1, depth / 40)^2 |d|^2
// over the CT box (depth: over the body). The field fades with depth by the last term and not by a
// factor, which would leave the spline space and the proof. Not in the paper.
// Cost: 0.3 s on two cores with a 30 mm grid.
#pragma once

#include <span>

#include "formats/registration/registration.h"
#include "pipeline/base/progress.h"
#include "pipeline/registration/matching/matching.h"

namespace sonocase::pipeline {

struct ResidualOptions {
    double spacing_mm = 30;       // of control points, >= 10
    double bending = 0.001;       // lb
    double stretching = 0.003;    // lm
    double depth_penalty = 0.14;  // mu
    double fade_mm = 40;          // depth at which the penalty is whole
    int rounds = 6;               // of matching
    double tolerance = 1e-3;      // of the solver
    int skin_queries = 2500;
    double inside_mm = 1.5;  // the field moves the inside of the body by no more on average
    int attempts = 6;  // bending doubles when the proof fails, depth grows with the inside's move
    double least_gain = 1.15;  // rms before over rms after; less buys nothing and is left away
};

struct ResidualReport {
    bool used = false;
    const char* reason = "";                     // why not
    double bending = 0, depth_penalty = 0;       // that passed
    double inside_mm = 0;                        // mean displacement of the inside
    double least_det = 0;                        // proven, of the whole map
    double rms_before_mm = 0, rms_after_mm = 0;  // robust gaps of one set of matches
    int iterations = 0;                          // of conjugate gradients
};

// The field alone, unproven, for comparing poses: sets registration's residual. One that is there
// already, on the same grid, is the start.
struct FieldFit {
    Matches matches;        // after the last solve
    double energy_mm2 = 0;  // bending, stretching and depth together
    double rms_before_mm = 0, rms_after_mm = 0;
    int iterations = 0;
};
FieldFit fit_field(const SkinModel& skin,
                   const TargetSurface& target,
                   std::span<const std::uint32_t> readings,
                   const ResidualOptions& options,
                   Registration* registration,
                   const Progress& progress = {});

// inside        of the body, where organs lie; less the skin's origin
// registration  quadratic, no residual; ct_box set. On success its residual and min_det_jacobian
//               are set, otherwise it is unchanged.
ResidualReport fit_residual(const SkinModel& skin,
                            const TargetSurface& target,
                            std::span<const std::uint32_t> readings,
                            std::span<const Point3> inside,
                            const ResidualOptions& options,
                            Registration* registration,
                            const Progress& progress = {});

}  // namespace sonocase::pipeline
