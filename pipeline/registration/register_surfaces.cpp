// SPDX-License-Identifier: Apache-2.0

#include "pipeline/registration/register_surfaces.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>

#include "pipeline/base/stopwatch.h"
#include "pipeline/base/text.h"
#include "pipeline/registration/elastic/tissue_lattice.h"
#include "pipeline/registration/map/map_proofs.h"
#include "pipeline/registration/pose_choice.h"
#include "pipeline/registration/warp_fit.h"

namespace sonocase::pipeline::inline registration {

namespace {

// The reports of a registration: measures for --report, warnings for people.

void add_fit(StageReport& report, const std::string& step, const FitMeasure& fit) {
    report.measures.push_back({step + "_rms_mm", fit.rms_mm});
    report.measures.push_back({step + "_median_mm", fit.median_mm});
    report.measures.push_back({step + "_p95_mm", fit.p95_mm});
    report.measures.push_back({step + "_max_mm", fit.max_mm});
    report.measures.push_back({step == "skin" ? "coverage" : step + "_coverage", fit.coverage});
}

void add_target(StageReport& report, const TargetSurface& t) {
    report.measures.push_back({"readings", static_cast<double>(t.points.size())});
    report.measures.push_back({"readings_not_finite", static_cast<double>(t.not_finite)});
    report.measures.push_back({"readings_repeated", static_cast<double>(t.repeated)});
    report.measures.push_back({"readings_lifted_off", static_cast<double>(t.lift_offs)});
    report.measures.push_back({"table_readings", static_cast<double>(t.table.readings)});
    report.measures.push_back({"reading_spacing_mm", t.spacing_mm});
}

void add_organs(StageReport& report, const WarpFit& w) {
    MeasureGroup volume{"volume_change", {}}, shape{"shape_change", {}};
    MeasureGroup median{"unknown_median_mm", {}}, p90{"unknown_p90_mm", {}},
        p95{"unknown_p95_mm", {}}, covariance{"unknown_p90_of_covariance_mm", {}},
        refits{"unknown_p90_of_refits_mm", {}}, halves{"halves_p90_mm", {}},
        held{"unknown_p90_with_two_landmarks_mm", {}};
    for (const OrganChange& c : w.organs) {
        volume.values.push_back({c.label, c.volume_ratio});
        shape.values.push_back({c.label, c.shape_change});
    }
    for (const OrganUnknown& u : w.unknown) {
        median.values.push_back({u.label, u.median_mm});
        p90.values.push_back({u.label, u.p90_mm});
        p95.values.push_back({u.label, u.p95_mm});
        covariance.values.push_back({u.label, u.covariance.p90_mm});
        if (u.refits.p90_mm > 0) refits.values.push_back({u.label, u.refits.p90_mm});
        if (u.halves_p90_mm > 0) halves.values.push_back({u.label, u.halves_p90_mm});
        if (u.p90_with_landmarks_mm > 0) held.values.push_back({u.label, u.p90_with_landmarks_mm});
    }
    report.groups = {std::move(volume), std::move(shape), std::move(median), std::move(p90),
                     std::move(p95)};
    for (MeasureGroup* group : {&covariance, &refits, &halves, &held})
        if (!group->values.empty()) report.groups.push_back(std::move(*group));
}

void warn_of_readings(StageReport& report, const FitContext& s, const FitMeasure& fit) {
    const TargetSurface& t = s.target;
    if (t.not_finite > 0) {
        report.warnings.push_back(
            text("%ld rows of the surface are not finite and were left out", t.not_finite));
    }
    // A careful sweep has none. Those nearer to the skin than the limit are not found.
    if (t.lift_offs > static_cast<long>(t.points.size()) / 50) {
        report.warnings.push_back(
            text("%ld of %ld readings lie off the surface of their neighbours: keep the sensor on "
                 "the skin",
                 t.lift_offs, static_cast<long>(t.points.size())));
    }
    if (t.points.size() < 300) {
        report.warnings.push_back(
            text("only %ld readings, %.0f mm apart: what lies between them is not fitted; sweep "
                 "again, more densely",
                 static_cast<long>(t.points.size()), t.spacing_mm));
    }
    // Careful sweeps have none; buttocks that are pressed flat, or an arm, some in a hundred.
    const bool off_skin = fit.off_skin > fit.readings / 20;
    if (off_skin) {
        report.warnings.push_back(
            text("%ld of %ld readings lie more than %.0f mm off the fitted skin, and not beyond "
                 "its ends: if they are of a hand or an arm, a table or a sensor that was laid "
                 "down, leave them out and fit again",
                 fit.off_skin, fit.readings, kOffSkinMm));
    }
    if (fit.coverage < 0.5 && !off_skin) {
        report.warnings.push_back(text(
            "only %.0f %% of the readings have a counterpart on the patient's skin: is it the same "
            "part of the body?",
            100 * fit.coverage));
    }
    if (fit.skin_coverage < 0.65 && !(s.hints.up && !s.landmarks.empty()) &&
        s.landmarks.size() < 3) {
        report.warnings.push_back(text(
            "the readings cover only %.0f %% of the patient's skin: tilt and place along the body "
            "are weakly determined; %s",
            100 * fit.skin_coverage,
            s.hints.up
                ? "add a landmark low on the body, such as the crotch (--landmarks FILE.csv)"
                : "give the head direction (--up X,Y,Z) and a landmark low on the body, such "
                  "as the crotch (--landmarks FILE.csv)"));
    }
}

// Readings of two poses, which one map cannot fit. Parts that meet along a border alone show that
// they do not fit each other, and hardly by how much they moved.
void warn_of_motion(StageReport& report, const FitContext& s) {
    constexpr double kMeasured = 0.5;  // share of the smaller part that both were read in
    const SweepMotion& m = s.motion;
    if (!m.found) return;
    const std::string by =
        m.overlap > kMeasured ? text(" by %.0f mm and %.1f degrees", m.shift_mm, m.turn_deg) : "";
    report.warnings.push_back(
        text("the mannequin, or what the tracker's frame hangs on, moved while it was swept%s, "
             "from about reading %ld on: the surfaces before and after lie %.1f mm apart, and "
             "%.1f mm if that is undone; sweep again with both held fast, or leave out one part",
             by.c_str(), static_cast<long>(s.target.given_as[m.first_after]) + 1, m.gap_mm,
             m.closed_gap_mm));
}

// How wide and how deep the readings are, in ratio to the patient who lies so: the middle nine
// tenths of both.
std::array<double, 2> size_ratios(const FitContext& s, const Rigid& pose) {
    std::array<double, 2> ratios{};
    const auto extent = [](std::vector<double> along) {
        std::sort(along.begin(), along.end());
        return along[along.size() - 1 - along.size() / 20] - along[along.size() / 20];
    };
    for (int axis = 0; axis < 2; ++axis) {
        std::vector<double> readings, skin;
        for (const std::uint32_t i : s.readings)
            readings.push_back(dot(pose.rotation.column(axis), s.target.points[i] - Point3{}));
        for (const Point3 p : s.fine.points) skin.push_back(p[axis]);
        if (readings.empty() || skin.empty()) return {1, 1};
        ratios[static_cast<std::size_t>(axis)] =
            extent(std::move(readings)) / std::max(1.0, extent(std::move(skin)));
    }
    return ratios;
}

// A child on an adult's mannequin, or readings in another unit. Another build is up to 1.2 times as
// wide and as deep; a front has its full width and a flank its full depth.
void warn_of_size(StageReport& report, const FitContext& s, const Rigid& pose) {
    constexpr double kSmaller = 0.75, kLarger = 1.3, kEither = 1.15;
    const auto [wide, deep] = size_ratios(s, pose);
    const double both = std::sqrt(wide * deep);
    if (both < kSmaller && std::max(wide, deep) < 1 / kEither) {
        report.warnings.push_back(
            text("the readings are %.2f times as wide and %.2f times as deep as the patient: they "
                 "are of a smaller body, or of a small part of one; choose a mannequin nearer to "
                 "his size, or check both units (--scale)",
                 wide, deep));
    } else if (both > kLarger && std::min(wide, deep) > kEither) {
        report.warnings.push_back(
            text("the readings are %.2f times as wide and %.2f times as deep as the patient: "
                 "choose a mannequin nearer to his size, or check both units (--scale)",
                 wide, deep));
    }
}

// A landmark is wrong if neither its own error nor that of the map explains its distance: four
// standard deviations per axis are exceeded by one distance in a thousand.
void warn_of_landmarks(StageReport& report, const RegisterOptions& options, const WarpFit& w) {
    const double map_mm = w.trust.inside_mm;
    const double usual =
        4 * std::sqrt(options.landmark_mm * options.landmark_mm + map_mm * map_mm / 3);
    for (const Landmark& mark : options.landmarks) {
        const double off = distance(mannequin_from_ct(w.registration, mark.ct), mark.mannequin);
        if (off > usual) {
            report.warnings.push_back(
                text("landmark '%s' ends %.0f mm from its place, more than the %.0f mm that its "
                     "own error and the map's allow: check its coordinates",
                     mark.name.c_str(), off, usual));
        }
    }
}

StageReport align_report(const FitContext& s,
                         const PoseChoice& choice,
                         const FitMeasure& fit,
                         double seconds) {
    StageReport report;
    report.stage = stage_names::kAlign;
    report.version = kRegisterVersion;
    report.seconds = seconds;
    add_target(report, s.target);
    add_fit(report, "rigid", fit);
    report.measures.push_back({"pose_score_mm", choice.best.score_mm});
    report.measures.push_back({"mirror_score_mm", choice.mirror_score_mm});
    if (s.hints.up) report.measures.push_back({"head_turned_score_mm", choice.turned_score_mm});
    report.measures.push_back({"front_turned_score_mm", choice.front_turned_score_mm});
    report.measures.push_back({"starts_at_pose", static_cast<double>(choice.best.rigid.found)});
    report.measures.push_back({"open_side_size", s.open_side.size});
    report.measures.push_back({"moved_mm", s.motion.found ? s.motion.shift_mm : 0});
    report.measures.push_back({"moved_deg", s.motion.found ? s.motion.turn_deg : 0});
    if (choice.open_side_dropped) {
        report.notes = {
            {"open_side", "none"},
            {"open_side_reason", "the sweep is of a flank, which says nothing of the back"}};
    } else {
        report.notes = {{"open_side", s.open_side_is}, {"open_side_reason", s.open_side_why}};
    }
    if (!choice.head.empty()) report.notes.push_back({"head", choice.head});
    report.notes.push_back({"handedness", choice.handedness});
    report.notes.push_back({"front", choice.front});
    if (!choice.runners_up.empty()) {
        const RunnerUp& r = choice.runners_up.front();
        report.measures.push_back({"runner_up_score_mm", r.score_mm});
        report.measures.push_back({"runner_up_turn_deg", r.turn_deg});
        report.measures.push_back({"runner_up_shift_mm", r.shift_mm});
        report.measures.push_back({"runner_up_coverage", r.coverage});
    }
    report.warnings = choice.warnings;
    warn_of_motion(report, s);
    return report;
}

StageReport warp_report(const FitContext& s,
                        const WarpFit& w,
                        const RegisterOptions& options,
                        double seconds) {
    StageReport report;
    report.stage = stage_names::kWarp;
    report.version = kRegisterVersion;
    report.seconds = seconds;
    add_fit(report, "skin", w.fit);
    report.measures.push_back({"min_det_jacobian", w.min_det});
    report.measures.push_back({"sampled_min_det_jacobian", w.sampled_det});
    report.measures.push_back({"skin_bias_mm", w.fit.mean_signed_mm});
    report.measures.push_back({"skin_coverage", w.fit.skin_coverage});
    report.measures.push_back({"skin_behind_table_mm", w.fit.behind_table_mm});
    report.measures.push_back({"counterparts", static_cast<double>(w.fit.counterparts)});
    report.measures.push_back({"unexplained_readings", static_cast<double>(w.fit.unexplained)});
    report.measures.push_back({"readings_off_skin", static_cast<double>(w.fit.off_skin)});
    add_fit(report, "quadratic", w.quadratic_fit);
    if (options.paper_warp) {
        report.measures.push_back({"consensus", w.ransac.consensus});
        report.measures.push_back({"rigid_consensus", w.ransac.rigid_consensus});
        report.measures.push_back({"consensus_mm", w.ransac.consensus_mm});
        report.measures.push_back({"folding_trials", static_cast<double>(w.ransac.folding_trials)});
    }
    report.measures.push_back({"constraint_mm", w.constraint_mm});
    report.measures.push_back({"quadratic_condition", w.condition});
    report.measures.push_back({"gap_standard_error_mm", w.trust.standard_error_mm});
    report.measures.push_back({"held_out_mm", w.trust.held_out_mm});
    report.measures.push_back({"rigid_held_out_mm", w.rigid_trust.fitted_mm});
    report.measures.push_back({"gap_design_effect", w.trust.design_effect});
    report.measures.push_back({"predicted_interior_mm", w.inside_mm});
    if (w.with_landmarks_mm > 0)
        report.measures.push_back({"interior_with_two_landmarks_mm", w.with_landmarks_mm});
    report.measures.push_back({"residual_warp", w.residual.used ? 1.0 : 0.0});
    report.measures.push_back({"residual_bending", w.residual.used ? w.residual.bending : 0.0});
    report.measures.push_back({"residual_mean_mm", w.residual_mean_mm});
    report.measures.push_back(
        {"residual_interior_move_mm", w.residual.used ? w.residual.inside_mm : 0.0});
    report.measures.push_back({"residual_iterations", static_cast<double>(w.residual.iterations)});
    report.measures.push_back({"least_minor", w.one_to_one.min_minor()});
    report.measures.push_back({"elastic_stiffness", w.stiffness});
    report.measures.push_back({"elastic_refits", static_cast<double>(w.elastic_refits)});
    report.measures.push_back({"elastic_strain_mm2", w.elastic.strain_mm2});
    report.measures.push_back({"elastic_iterations", static_cast<double>(w.elastic.iterations)});
    report.notes = {{"path", w.path}, {"path_reason", w.reason}};
    if (!w.organs.empty()) add_organs(report, w);
    report.warnings = w.warnings;
    warn_of_readings(report, s, w.fit);
    warn_of_landmarks(report, options, w);
    return report;
}

RegisterResult align(const FitContext& s,
                     const RegisterOptions& options,
                     const Stopwatch& watch,
                     const Progress& progress) {
    const PoseChoice choice = choose_pose(s, options, progress);
    const auto take = [&](const Rigid& pose, RegisterResult* result) {
        result->registration = in_frames(s, RigidQuadratic::from_rigid(pose));
        result->registration.min_det_jacobian = 1;
        result->fit = measure_fit(s.skin, s.target, result->registration);
    };
    const Rigid chosen = choice.best.rigid.target_from_skin;
    RegisterResult result, before;
    take(refine_rigid_robust(s.fine, s.target, chosen, s.hints, 6, 15), &result);
    // Where bodies differ much the least gaps are those of a pose that has slid off the readings.
    take(chosen, &before);
    if (slid_off(result.fit.coverage, before.fit.coverage)) result = before;
    result.rigid_fit = result.quadratic_fit = result.fit;
    result.runners_up = choice.runners_up;
    result.report = align_report(s, choice, result.fit, watch.seconds());
    warn_of_size(result.report, s, chosen);
    result.registration.reports = {result.report};
    return result;
}

RegisterResult warp(const FitContext& s,
                    const Rigid& mannequin_from_ct,
                    const RegisterOptions& options,
                    const Stopwatch& watch,
                    const Progress& progress) {
    const Rigid pose{mannequin_from_ct.rotation,
                     mannequin_from_ct * s.fine.origin - s.target.origin};
    const WarpFit w = fit_warp(s, pose, options, progress);
    RegisterResult result;
    result.registration = w.registration;
    result.rigid_fit = w.rigid_fit;
    result.quadratic_fit = w.quadratic_fit;
    result.fit = w.fit;
    result.organs = w.organs;
    result.unknown = w.unknown;
    result.report = warp_report(s, w, options, watch.seconds());
    result.registration.reports = {result.report};
    return result;
}

}  // namespace

Result<RegisterResult> align_surfaces(const RegisterInput& input,
                                      const RegisterOptions& options,
                                      const Progress& progress) {
    const Stopwatch watch;
    SONOCASE_TRY(FitContext s, prepare_fit(input, options));
    return align(s, options, watch, progress);
}

Result<RegisterResult> warp_surfaces(const RegisterInput& input,
                                     const Rigid& mannequin_from_ct,
                                     const RegisterOptions& options,
                                     const Progress& progress) {
    const Stopwatch watch;
    SONOCASE_TRY(FitContext s, prepare_fit(input, options));
    return warp(s, mannequin_from_ct, options, watch, progress);
}

Result<RegisterResult> register_surfaces(const RegisterInput& input,
                                         const RegisterOptions& options,
                                         const Progress& progress) {
    const Stopwatch watch;
    SONOCASE_TRY(FitContext s, prepare_fit(input, options));
    const RegisterResult aligned = align(s, options, watch, progress);
    RegisterResult result =
        warp(s, aligned.registration.mannequin_from_ct, options, Stopwatch(), progress);
    result.runners_up = aligned.runners_up;
    const StageReport align_stage = aligned.report, warp_stage = result.report;
    result.registration.reports = {align_stage, warp_stage};
    result.report = warp_stage;
    result.report.stage = "register";
    result.report.measures.insert(result.report.measures.end(), align_stage.measures.begin(),
                                  align_stage.measures.end());
    result.report.notes.insert(result.report.notes.end(), align_stage.notes.begin(),
                               align_stage.notes.end());
    result.report.warnings.insert(result.report.warnings.begin(), align_stage.warnings.begin(),
                                  align_stage.warnings.end());
    result.report.measures.push_back({"align_seconds", align_stage.seconds});
    result.report.measures.push_back({"warp_seconds", warp_stage.seconds});
    result.report.seconds = watch.seconds();
    report_progress(progress, 1, "done");
    return result;
}

namespace {

constexpr double kGoodSkinMm = 2.7, kGoodVolume = 0.08, kGoodCoverage = 0.6;

}  // namespace

double Misfit::worst() const {
    return std::max({skin, volume, shape, coverage});
}

Misfit misfit_of(const RegisterResult& result) {
    Misfit m;
    const FitMeasure& fit = result.fit;
    m.skin = fit.p95_mm >= 0 ? fit.p95_mm / kGoodSkinMm : INFINITY;
    m.coverage = fit.coverage > 0 ? kGoodCoverage / fit.coverage : INFINITY;
    const auto count = [&](const OrganChange& c) {
        if (c.before_ml < kMinOrganMl) return;
        m.volume = std::max(m.volume, std::abs(c.volume_ratio - 1) / kGoodVolume);
        m.shape = std::max(m.shape, c.shape_change / kShapeTolerance);
    };
    count(joint_change(result.organs, "bones", is_bone));
    for (const OrganChange& c : result.organs) {
        if (is_solid_organ(c.tissue)) count(c);
    }
    const auto minor = std::find_if(result.report.measures.begin(), result.report.measures.end(),
                                    [](const Measure& x) { return x.name == "least_minor"; });
    m.proven = result.registration.min_det_jacobian > kMinDetJacobian &&
               minor != result.report.measures.end() && minor->value > 0;
    return m;
}

std::vector<std::size_t> rank_results(const std::vector<RegisterResult>& results) {
    std::vector<std::size_t> order(results.size());
    std::iota(order.begin(), order.end(), std::size_t{0});
    std::vector<Misfit> misfit;
    for (const RegisterResult& r : results) misfit.push_back(misfit_of(r));
    std::stable_sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) {
        if (misfit[a].proven != misfit[b].proven) return misfit[a].proven;
        return misfit[a].worst() < misfit[b].worst();
    });
    return order;
}

}  // namespace sonocase::pipeline::inline registration
