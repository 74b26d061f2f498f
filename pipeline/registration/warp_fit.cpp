// SPDX-License-Identifier: Apache-2.0

#include "pipeline/registration/warp_fit.h"

#include <algorithm>
#include <cmath>

#include "pipeline/base/text.h"
#include "pipeline/registration/elastic/tissue_lattice.h"
#include "pipeline/registration/fit_unknown.h"
#include "pipeline/registration/map/map_proofs.h"

namespace sonocase::pipeline::inline registration {

namespace {

constexpr int kRefits = 2;  // stiffer fits after each of the two first ones, near and far
constexpr double kStiffer = 1.5, kStrongerBarrier = 3;
// An elastic map that ends farther from the readings than this is not kept unless it was asked for.
constexpr double kPoorMedianMm = 1.5, kPoorP95Mm = 6;
// Where no elastic warp is possible, a residual warp that changes an organ by more than this is not
// kept either.
constexpr double kDistortedVolume = 0.25;
// Fewer readings than this with a counterpart: the skin slid past them, and is tried from farther.
constexpr double kPoorCoverage = 0.55;
// 95th percentile of readings about a skin that they lie on: 1.4 mm with noise of 0.7 mm.
constexpr double kNoiseMm = 1.8;
// Skin of the back farther behind the table than this does not suffice.
constexpr double kBehindTableMm = 15;
// Fewer readings do not determine a field: it would follow their noise.
constexpr std::size_t kMinReadings = 200;

struct Proofs {
    FoldProof fold;
    OneToOneProof one_to_one;
    bool pass() const { return fold.min_bound > kMinDetJacobian && one_to_one.proven(); }
};

Proofs prove(const Registration& map) {
    return {prove_no_fold(map), prove_one_to_one(map)};
}

// The bones together and each solid organ above 20 ml: the one that changes most in volume.
OrganChange worst_change(const std::vector<OrganChange>& organs) {
    OrganChange worst = joint_change(organs, "bones", is_bone);
    const auto change = [](const OrganChange& c) {
        return c.before_ml >= kMinOrganMl ? std::abs(c.volume_ratio - 1) : -1;
    };
    for (const OrganChange& c : organs) {
        if (is_solid_organ(c.tissue) && change(c) > change(worst)) worst = c;
    }
    return worst;
}

// Why the map with the residual warp does not suffice; empty if it does.
std::string shortcoming(const WarpFit& w, const Proofs& proofs) {
    if (!(w.fit.p95_mm <= kSufficientP95Mm)) {
        return text(
            "the residual warp leaves readings %.1f mm from the skin (95th percentile; "
            "%.0f mm are wanted)",
            w.fit.p95_mm, kSufficientP95Mm);
    }
    if (w.fit.behind_table_mm > kBehindTableMm) {
        return text("the residual warp leaves skin %.0f mm behind the table",
                    w.fit.behind_table_mm);
    }
    if (!(proofs.fold.min_bound > kMinDetJacobian))
        return "the residual warp is not proven free of folds";
    if (!proofs.one_to_one.proven()) return "the residual warp is not proven one to one";
    // A quadratic that leaves noise alone, and explained patches that it was not fitted to, is more
    // probably true than a body of the same skin whose organs keep their volume: on known quadratic
    // maps it ends 0.3 to 0.9 mm from the truth inside, and the elastic warp 4 to 6 mm.
    if (w.quadratic_fit.p95_mm <= kNoiseMm) return "";
    const OrganChange worst = worst_change(w.organs);
    if (worst.before_ml >= kMinOrganMl && std::abs(worst.volume_ratio - 1) > kSufficientVolume) {
        return text("the residual warp changes the volume of %s by %+.0f %%", worst.label.c_str(),
                    100 * (worst.volume_ratio - 1));
    }
    return "";
}

struct ElasticTrial {
    Registration map;
    ElasticFit fit;
    Proofs proofs;
    double stiffness = 1;
    int refits = 0;
};

ElasticTrial fit_and_prove(const FitContext& s,
                           const RegisterOptions& options,
                           const Registration& quadratic,
                           bool far,
                           const Progress& progress) {
    const ElasticInput input{.skin = s.fine,
                             .target = s.target,
                             .readings = s.readings,
                             .landmarks = s.landmarks,
                             .landmark_weight = s.hints.landmark_weight,
                             .labels = s.labels};
    ElasticOptions elastic = options.elastic;
    elastic.spacing_mm = options.residual.spacing_mm;
    elastic.far = far;
    ElasticTrial trial;
    for (;; ++trial.refits) {
        trial.map = quadratic;
        trial.fit = fit_elastic(input, elastic, &trial.map, progress);
        trial.proofs = prove(trial.map);
        trial.stiffness = elastic.stiffness;
        if (trial.proofs.pass() || trial.refits == kRefits) return trial;
        elastic.stiffness *= kStiffer;
        elastic.barrier *= kStrongerBarrier;
    }
}

void warn_of_organs(WarpFit* w) {
    int told = 0;
    for (const OrganChange& c : w->organs) {
        if (!is_bone(c.tissue) && !is_solid_organ(c.tissue)) continue;
        if (c.before_ml < kMinOrganMl) continue;
        const bool volume = std::abs(c.volume_ratio - 1) > kVolumeTolerance;
        if (!volume && c.shape_change <= kShapeTolerance) continue;
        if (++told > 6) continue;
        w->warnings.push_back(
            volume
                ? text("the map changes the volume of %s by %+.0f %%: choose a mannequin nearer "
                       "to the patient's build, or stiffer tissues (--stiffness)",
                       c.label.c_str(), 100 * (c.volume_ratio - 1))
                : text("the map changes the shape of %s by %.0f %%: choose a mannequin nearer to "
                       "the patient's build, or stiffer tissues (--stiffness)",
                       c.label.c_str(), 100 * c.shape_change));
    }
    if (told > 6) {
        w->warnings.push_back(
            text("%d more structures change in volume by more than 10 %% or in shape by more than "
                 "20 %%; see volume_change and shape_change",
                 told - 6));
    }
}

void take(const FitContext& s, Registration map, const Proofs& proofs, WarpFit* w) {
    w->registration = std::move(map);
    w->min_det = w->registration.min_det_jacobian = proofs.fold.min_bound;
    w->sampled_det = proofs.fold.min_sample;
    w->one_to_one = proofs.one_to_one;
    if (s.labels) w->organs = organ_changes(*s.labels, w->registration);
}

constexpr const char* kAdvice =
    "give two landmarks that lie far apart (--landmarks FILE.csv), or choose a mannequin nearer to "
    "the patient's build";

}  // namespace

void choose_warp(const FitContext& s,
                 const RegisterOptions& options,
                 const Progress& progress,
                 WarpFit* w) {
    Registration quadratic = w->registration;
    quadratic.residual = {};
    const Proofs spline{{w->min_det, w->sampled_det}, prove_one_to_one(w->registration)};
    take(s, w->registration, spline, w);
    w->path = w->residual.used ? "residual" : "quadratic";
    const bool possible = options.residual_warp && !options.paper_warp;
    const std::string wanting = shortcoming(*w, spline);
    if (!possible || options.path == "residual" || (options.path == "auto" && wanting.empty())) {
        w->reason = !possible                    ? "the recipe wants no residual warp"
                    : options.path == "residual" ? "the recipe wants the residual warp"
                    : w->residual.used
                        ? "the residual warp suffices"
                        : std::string("the quadratic suffices: ") + w->residual.reason;
        warn_of_organs(w);
        return;
    }
    const bool asked_for = options.path == "elastic";
    if (!asked_for && s.readings.size() < kMinReadings) {
        w->reason =
            wanting + text("; %zu readings are too few for the elastic warp", s.readings.size());
        warn_of_organs(w);
        return;
    }
    report_progress(progress, 0.7, "elastic warp");
    ElasticTrial trial = fit_and_prove(s, options, quadratic, false, progress);
    FitMeasure fit = measure_fit(s.skin, s.target, trial.map);
    if (!trial.proofs.pass() || fit.coverage < kPoorCoverage || fit.p95_mm > kPoorP95Mm) {
        ElasticTrial other = fit_and_prove(s, options, quadratic, true, progress);
        const FitMeasure other_fit = measure_fit(s.skin, s.target, other.map);
        if (other.proofs.pass() && (!trial.proofs.pass() || other_fit.coverage > fit.coverage)) {
            trial = std::move(other);
            fit = other_fit;
        }
    }
    const std::string why = asked_for ? "the recipe wants the elastic warp" : wanting;
    w->elastic = trial.fit;
    w->elastic_refits = trial.refits;
    w->stiffness = trial.stiffness;
    const bool close = asked_for || (fit.median_mm <= kPoorMedianMm && fit.p95_mm <= kPoorP95Mm);
    const bool gains = asked_for || fit.p95_mm < w->fit.p95_mm || w->fit.p95_mm <= kSufficientP95Mm;
    if (trial.proofs.pass() && close && gains) {
        w->path = "elastic";
        w->reason = why;
        w->fit = fit;
        std::erase_if(w->warnings,
                      [](const std::string& text) { return text.starts_with("no residual warp"); });
        take(s, std::move(trial.map), trial.proofs, w);
        warn_of_organs(w);
        return;
    }
    const std::string refused =
        !trial.proofs.pass()
            ? text("no elastic warp is proven one to one (det J >= %.2f, least minor %.2f)",
                   trial.proofs.fold.min_bound, trial.proofs.one_to_one.min_minor())
            : text(
                  "the elastic warp leaves readings %.1f mm from the skin at the median and %.1f "
                  "mm "
                  "at the 95th percentile",
                  fit.median_mm, fit.p95_mm);
    w->reason = why + "; " + refused;
    w->warnings.push_back("the bodies differ by more than the map can close: " + refused + "; " +
                          kAdvice);
    const bool distorted = std::abs(worst_change(w->organs).volume_ratio - 1) > kDistortedVolume;
    if (w->path == "residual" && (!spline.pass() || distorted)) {
        const Proofs proofs = prove(quadratic);
        w->path = "quadratic";
        w->fit = w->quadratic_fit;
        w->residual.used = false;
        take(s, std::move(quadratic), proofs, w);
    }
    warn_of_organs(w);
}

namespace {

// The stiffest weight comes first; each of the next is at most this factor smaller.
constexpr double kFirstConstraintMm = 30, kLighter = 3.2;
constexpr int kMaxWeights = 6;

struct Quadratic {
    RigidQuadratic map;
    std::vector<RefineOptions> steps;
    double constraint_mm = 0, condition = 0;
    QuadraticTrust trust;
};

// Decreasing weights, down to what the gaps justify or the option says. The start is the rigid pose
// and the steps are few, on purpose: skins tell little of displacements along them, which stay as
// the rigid alignment left them. Run to its end at the first weight, the map of two unlike torsos
// slides along the body until a fifth of the readings has lost its counterpart, for gaps that are
// no truer; from the samples of a random consensus it ends in basins 10 mm apart.
Quadratic descend(const FitContext& s,
                  const RigidQuadratic& start,
                  const RegisterOptions& options) {
    Quadratic best;
    best.map = start;
    RefineOptions refine;
    refine.landmarks = s.landmarks;
    refine.landmark_weight = s.hints.landmark_weight;
    refine.iterations = 7;
    double constraint = std::max(kFirstConstraintMm, options.constraint_mm);
    for (int n = 0; n < kMaxWeights; ++n) {
        refine.constraint_mm = constraint;
        const RefineResult refined =
            refine_quadratic(s.fine, s.target, s.readings, best.map, refine);
        if (!(proven_min_det(refined.map, s.box) >= options.wanted_det)) break;
        best.map = refined.map;
        best.steps.push_back(refine);
        best.constraint_mm = constraint;
        best.condition = refined.condition;
        best.trust = trust_quadratic(s.fine, s.target, s.readings, best.map, refine, options.strain,
                                     s.inside);
        const double deserved =
            options.constraint_mm > 0
                ? options.constraint_mm
                : std::max(options.min_constraint_mm,
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
    RigidQuadratic q = start, judged = start;  // the map, and the one that w.trust is of
    RefineOptions stiff;
    stiff.constraint_mm = kFirstConstraintMm;
    w.rigid_trust =
        trust_quadratic(s.fine, s.target, s.readings, start, stiff, options.strain, s.inside);
    if (options.paper_warp) {
        report_progress(progress, 0.4, "quadratic warp: trials");
        RansacOptions ransac = options.ransac;
        ransac.seed = options.seed;
        w.ransac = ransac_quadratic(s.fine, s.target, rigid, s.box, ransac, progress);
        q = w.ransac.map;
    } else {
        report_progress(progress, 0.55, "quadratic warp: point to surface");
        const Quadratic fitted = descend(s, start, options);
        // Never worse than the rigid map: patches that the fit did not see must lie closer as well.
        w.kept_rigid =
            !(fitted.trust.patches > 0 && fitted.trust.held_out_mm < w.rigid_trust.fitted_mm);
        w.trust = fitted.trust;
        w.steps = fitted.steps;
        judged = fitted.map;
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
    w.registration.min_det_jacobian = proof.min_bound;
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
        } else if (w.residual.min_det != 0) {
            w.warnings.push_back(text("no residual warp: %s (least det J %.2f)", w.residual.reason,
                                      w.residual.min_det));
        }
    }
    w.min_det = w.registration.min_det_jacobian = proof.min_bound;
    w.sampled_det = proof.min_sample;
    w.fit = w.residual.used ? measure_fit(s.skin, s.target, w.registration) : w.quadratic_fit;
    choose_warp(s, options, progress, &w);
    find_unknown(s, rigid, judged, options, progress, &w);
    report_progress(progress, 0.95, "measuring");
    if (!(w.min_det > kMinDetJacobian)) {
        w.warnings.push_back(
            text("the map is not proven free of folds (det J >= %.3f)", w.min_det));
    }
    return w;
}

}  // namespace sonocase::pipeline::inline registration
