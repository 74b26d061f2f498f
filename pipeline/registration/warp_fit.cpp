// SPDX-License-Identifier: Apache-2.0

#include "pipeline/registration/warp_fit.h"

#include <algorithm>
#include <cmath>

#include "pipeline/base/line_text.h"
#include "pipeline/registration/map/fold_proof.h"
#include "pipeline/registration/path_choice.h"

namespace sonocase::pipeline {
namespace {

// The stiffest weight comes first; each of the next is at most this factor smaller.
constexpr double kFirstConstraint_mm = 30, kLighter = 3.2;
constexpr int kMostWeights = 6;

// Landmarks are weighted by their evidence relative to that of the readings.
double landmark_weight(const QuadraticTrust& trust, double landmark_mm) {
    const double ratio = trust.standard_error_mm / std::max(landmark_mm, 0.1);
    return std::clamp(ratio * ratio, 1e-5, 0.02);
}

struct Quadratic {
    RigidQuadratic map;
    double constraint_mm = 0, condition = 0;
    QuadraticTrust trust;
};

// Decreasing weights, down to what the gaps justify or the option says.
Quadratic descend(const FitContext& s,
                  const RigidQuadratic& start,
                  const RegisterOptions& options) {
    Quadratic best;
    best.map = start;
    RefineOptions refine;
    refine.landmarks = s.landmarks;
    refine.landmark_weight = s.hints.landmark_weight;
    refine.iterations = 7;
    double constraint = std::max(kFirstConstraint_mm, options.constraint_mm);
    for (int n = 0; n < kMostWeights; ++n) {
        refine.constraint_mm = constraint;
        const RefineResult refined =
            refine_quadratic(s.fine, s.target, s.readings, best.map, refine);
        if (!(proven_min_det(refined.map, s.box) >= options.wanted_det)) break;
        best.map = refined.map;
        best.constraint_mm = constraint;
        best.condition = refined.condition;
        best.trust = trust_quadratic(s.fine, s.target, s.readings, best.map, refine, options.strain,
                                     s.inside);
        const double deserved =
            options.constraint_mm > 0
                ? options.constraint_mm
                : std::max(options.least_constraint_mm,
                           std::sqrt(2.0) * best.trust.standard_error_mm / options.strain);
        if (constraint <= 1.05 * deserved) break;
        constraint = std::max(deserved, constraint / kLighter);
        refine.first_loss_mm = 4;
        refine.first_gate_mm = 40;
        refine.iterations = 6;
        refine.landmark_weight = landmark_weight(best.trust, options.landmark_mm);
    }
    return best;
}

double mean_move(const DisplacementGrid& field, Point3 origin, const std::vector<Point3>& points) {
    double sum = 0;
    for (Point3 p : points) sum += norm(displacement(field, origin + (p - Point3{})));
    return points.empty() ? 0 : sum / static_cast<double>(points.size());
}

}  // namespace

WarpFit fit_warp(const FitContext& s,
                 const Rigid& rigid,
                 const RegisterOptions& options,
                 const Progress& progress) {
    WarpFit w;
    const RigidQuadratic start = RigidQuadratic::from_rigid(rigid);
    w.rigid_fit = measure_fit(s.skin, s.target, in_frames(s, start));
    RansacOptions ransac = options.ransac;
    ransac.seed = options.seed;
    report_progress(progress, 0.4, "quadratic warp: trials");
    w.ransac = ransac_quadratic(s.fine, s.target, rigid, s.box, ransac, progress);
    RigidQuadratic q = w.ransac.map;
    RefineOptions stiff;
    stiff.constraint_mm = kFirstConstraint_mm;
    w.rigid_trust =
        trust_quadratic(s.fine, s.target, s.readings, start, stiff, options.strain, s.inside);
    if (!options.paper_warp) {
        report_progress(progress, 0.55, "quadratic warp: point to surface");
        // The result of the trials is another start beside the rigid one.
        const QuadraticTrust trial =
            trust_quadratic(s.fine, s.target, s.readings, q, stiff, options.strain, s.inside);
        if (!(trial.fitted_mm < w.rigid_trust.fitted_mm)) q = start;
        const Quadratic fitted = descend(s, q, options);
        // Never worse than the rigid map: patches that the fit did not see must lie closer as well.
        w.kept_rigid =
            !(fitted.trust.patches > 0 && fitted.trust.held_out_mm < w.rigid_trust.fitted_mm);
        w.trust = fitted.trust;
        q = w.kept_rigid ? start : fitted.map;
        if (!w.kept_rigid) {
            w.constraint_mm = fitted.constraint_mm;
            w.condition = fitted.condition;
        } else {
            w.warnings.push_back(text(
                "no quadratic warp: patches left out of its fit lie %.1f mm off, %.1f mm after "
                "the rigid alignment; sweep more of the skin",
                fitted.trust.held_out_mm, w.rigid_trust.fitted_mm));
        }
    }
    w.registration = in_frames(s, q);
    FoldProof proof = prove_no_fold(w.registration);
    w.registration.min_det_jacobian = proof.least_bound;
    w.quadratic_fit = measure_fit(s.skin, s.target, w.registration);
    if (options.residual_warp && !options.paper_warp && !w.kept_rigid &&
        options.path != "elastic") {
        report_progress(progress, 0.7, "residual warp");
        w.residual = fit_residual(s.fine, s.target, s.readings, s.inside, options.residual,
                                  &w.registration, progress);
        if (w.residual.used) {
            proof = prove_no_fold(w.registration);
            w.residual_mean_mm =
                mean_move(w.registration.residual, s.coarse.origin, s.coarse.points);
        } else if (w.residual.least_det != 0) {
            w.warnings.push_back(text("no residual warp: %s (least det J %.2f)", w.residual.reason,
                                      w.residual.least_det));
        }
    }
    w.least_det = w.registration.min_det_jacobian = proof.least_bound;
    w.sampled_det = proof.least_sample;
    w.fit = w.residual.used ? measure_fit(s.skin, s.target, w.registration) : w.quadratic_fit;
    choose_path(s, options, progress, &w);
    report_progress(progress, 0.95, "measuring");
    if (!(w.least_det > kLeastDetJacobian)) {
        w.warnings.push_back(
            text("the map is not proven free of folds (det J >= %.3f)", w.least_det));
    }
    return w;
}

}  // namespace sonocase::pipeline
