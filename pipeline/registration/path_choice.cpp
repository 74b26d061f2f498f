// SPDX-License-Identifier: Apache-2.0

#include "pipeline/registration/path_choice.h"

#include <algorithm>
#include <cmath>

#include "pipeline/base/line_text.h"
#include "pipeline/registration/elastic/tissue_lattice.h"
#include "pipeline/registration/map/fold_proof.h"

namespace sonocase::pipeline {
namespace {

constexpr int kRefits = 2;  // stiffer fits after each of the two first ones, near and far
constexpr double kStiffer = 1.5, kStrongerBarrier = 3;
// An elastic map that ends farther from the readings than this is not kept unless it was asked for.
constexpr double kPoorMedian_mm = 1.5, kPoorP95_mm = 6;
// Where no elastic warp can be had, a residual warp that changes an organ by more than this is not
// kept either.
constexpr double kDistortedVolume = 0.25;
// Fewer readings than this with a counterpart: the skin slid past them, and is tried from farther.
constexpr double kPoorCoverage = 0.55;
// 95th percentile of readings about a skin that they lie on: 1.4 mm with noise of 0.7 mm.
constexpr double kNoise_mm = 1.8;
// Skin of the back farther behind the table than this does not suffice.
constexpr double kBehindTable_mm = 15;
// Fewer readings do not determine a field: it would follow their noise.
constexpr std::size_t kFewestReadings = 200;

struct Proofs {
    FoldProof fold;
    OneToOneProof one_to_one;
    bool pass() const { return fold.least_bound > kLeastDetJacobian && one_to_one.proven(); }
};

Proofs prove(const Registration& map) {
    return {prove_no_fold(map), prove_one_to_one(map)};
}

// The bones together and each solid organ above 20 ml: the one that changes most in volume.
OrganChange worst_change(const std::vector<OrganChange>& organs) {
    OrganChange worst = joint_change(organs, "bones", is_bone);
    const auto change = [](const OrganChange& c) {
        return c.before_ml >= kLeastOrgan_ml ? std::abs(c.volume_ratio - 1) : -1;
    };
    for (const OrganChange& c : organs) {
        if (is_solid_organ(c.tissue) && change(c) > change(worst)) worst = c;
    }
    return worst;
}

// Why the map with the residual warp does not suffice; empty if it does.
std::string shortcoming(const WarpFit& w, const Proofs& proofs) {
    if (!(w.fit.p95_mm <= kSufficientP95_mm)) {
        return text(
            "the residual warp leaves readings %.1f mm from the skin (95th percentile; "
            "%.0f mm are wanted)",
            w.fit.p95_mm, kSufficientP95_mm);
    }
    if (w.fit.behind_table_mm > kBehindTable_mm) {
        return text("the residual warp leaves skin %.0f mm behind the table",
                    w.fit.behind_table_mm);
    }
    if (!(proofs.fold.least_bound > kLeastDetJacobian))
        return "the residual warp is not proven free of folds";
    if (!proofs.one_to_one.proven()) return "the residual warp is not proven one to one";
    // A quadratic that leaves noise alone, and explained patches that it was not fitted to, is more
    // probably true than a body of the same skin whose organs keep their volume: on known quadratic
    // maps it ends 0.3 to 0.9 mm from the truth inside, and the elastic warp 4 to 6 mm.
    if (w.quadratic_fit.p95_mm <= kNoise_mm) return "";
    const OrganChange worst = worst_change(w.organs);
    if (worst.before_ml >= kLeastOrgan_ml && std::abs(worst.volume_ratio - 1) > kSufficientVolume) {
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
    const ElasticInput input{s.fine,  s.target, s.readings, s.landmarks, s.hints.landmark_weight,
                             s.labels};
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
        if (c.before_ml < kLeastOrgan_ml) continue;
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
    w->least_det = w->registration.min_det_jacobian = proofs.fold.least_bound;
    w->sampled_det = proofs.fold.least_sample;
    w->one_to_one = proofs.one_to_one;
    if (s.labels) w->organs = organ_changes(*s.labels, w->registration);
}

constexpr const char* kCure =
    "give two landmarks that lie far apart (--landmarks FILE.csv), or choose a mannequin nearer to "
    "the patient's build";

}  // namespace

void choose_path(const FitContext& s,
                 const RegisterOptions& options,
                 const Progress& progress,
                 WarpFit* w) {
    Registration quadratic = w->registration;
    quadratic.residual = {};
    const Proofs spline{{w->least_det, w->sampled_det}, prove_one_to_one(w->registration)};
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
    if (!asked_for && s.readings.size() < kFewestReadings) {
        w->reason =
            wanting + text("; %zu readings are too few for the elastic warp", s.readings.size());
        warn_of_organs(w);
        return;
    }
    report_progress(progress, 0.7, "elastic warp");
    ElasticTrial trial = fit_and_prove(s, options, quadratic, false, progress);
    FitMeasure fit = measure_fit(s.skin, s.target, trial.map);
    if (!trial.proofs.pass() || fit.coverage < kPoorCoverage || fit.p95_mm > kPoorP95_mm) {
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
    const bool close = asked_for || (fit.median_mm <= kPoorMedian_mm && fit.p95_mm <= kPoorP95_mm);
    const bool gains =
        asked_for || fit.p95_mm < w->fit.p95_mm || w->fit.p95_mm <= kSufficientP95_mm;
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
                   trial.proofs.fold.least_bound, trial.proofs.one_to_one.least_minor())
            : text(
                  "the elastic warp leaves readings %.1f mm from the skin at the median and %.1f "
                  "mm "
                  "at the 95th percentile",
                  fit.median_mm, fit.p95_mm);
    w->reason = why + "; " + refused;
    w->warnings.push_back("the bodies differ by more than the map can close: " + refused + "; " +
                          kCure);
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

}  // namespace sonocase::pipeline
