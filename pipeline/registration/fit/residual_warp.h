// SPDX-License-Identifier: Apache-2.0

// The residual warp: a smooth displacement that closes the gaps which the quadratic leaves at the
// skin. A cubic B-spline, added and not composed, so that the proof of det J > 0.2 stays exact.
//
// Minimises the mean squared gap at the skin plus, all in mm^2,
//     bending  lb 50^4 mean |Hessian d|^2  +  stretching  lm 50^2 mean |grad d|^2
//     + depth  mu mean min(1, depth / 40)^2 |d|^2
// over the CT box (depth: over the body). The field fades with depth through the last term; a
// factor would leave the spline space and invalidate the proof. Not in the paper. Cost: 0.3 s on
// two cores with a 30 mm grid.
#pragma once

#include <span>

#include "pipeline/base/progress.h"
#include "pipeline/registration/fit/matching.h"
#include "pipeline/registration/fit/spline_penalty.h"
#include "pipeline/registration/map/registration.h"

namespace sonocase::pipeline::inline registration_fit {

struct ResidualOptions {
    double spacing_mm = 30;       // of control points, >= 10
    double bending = 0.001;       // lb
    double stretching = 0.003;    // lm
    double depth_penalty = 0.14;  // mu
    double fade_mm = 40;          // depth at which the penalty reaches its full value
    int rounds = 6;               // of matching
    double tolerance = 1e-3;      // of the solver
    int skin_queries = 2500;
    double inside_mm = 1.5;  // largest mean displacement inside the body
    // After each attempt bending doubles if the proof failed, and the depth penalty grows if the
    // inside moved too far.
    int attempts = 6;
    double min_gain = 1.15;  // rms before over rms after; a field that gains less is dropped
};

struct ResidualReport {
    bool used = false;
    const char* reason = "";                     // if not used
    double bending = 0, depth_penalty = 0;       // of the accepted field
    double inside_mm = 0;                        // mean displacement of the inside
    double min_det = 0;                          // proven, of the whole map
    double rms_before_mm = 0, rms_after_mm = 0;  // robust gaps of one set of matches
    int iterations = 0;                          // of conjugate gradients
};

// What a field costs. The same for every pose of a skin in its box.
SplinePenalty field_penalty(const SkinModel& skin,
                            const Box3& ct_box,
                            const ResidualOptions& options);

// The field without proof, for comparing poses: sets registration's residual. An existing one on
// the same grid is the start.
// penalty  of skin, registration's box and options
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
                   const SplinePenalty& penalty,
                   Registration* registration,
                   const Progress& progress = {});

// inside        of the body, where the organs are; relative to the skin's origin
// registration  quadratic, no residual; ct_box set. On success its residual and min_det_jacobian
//               are set, otherwise it is unchanged.
ResidualReport fit_residual(const SkinModel& skin,
                            const TargetSurface& target,
                            std::span<const std::uint32_t> readings,
                            std::span<const Point3> inside,
                            const ResidualOptions& options,
                            Registration* registration,
                            const Progress& progress = {});

}  // namespace sonocase::pipeline::inline registration_fit
