// SPDX-License-Identifier: Apache-2.0

#include "pipeline/registration/register_report.h"

#include <cmath>

#include "pipeline/base/line_text.h"

namespace sonocase::pipeline {
namespace {

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

void add_organs(StageReport& report, const std::vector<OrganChange>& organs) {
    MeasureGroup volume{"volume_change", {}}, shape{"shape_change", {}};
    for (const OrganChange& c : organs) {
        volume.values.push_back({c.label, c.volume_ratio});
        shape.values.push_back({c.label, c.shape_change});
    }
    report.groups = {std::move(volume), std::move(shape)};
}

void warn_of_readings(StageReport& report, const FitContext& s, const FitMeasure& fit) {
    const TargetSurface& t = s.target;
    if (t.not_finite > 0) {
        report.warnings.push_back(
            text("%ld rows of the surface are not finite and were left out", t.not_finite));
    }
    // A careful sweep has none; some more than are found lie nearer to the skin.
    if (t.lift_offs > static_cast<long>(t.points.size()) / 50) {
        report.warnings.push_back(
            text("%ld of %ld readings lie off the surface of their neighbours: keep the sensor on "
                 "the skin",
                 t.lift_offs, static_cast<long>(t.points.size())));
    }
    if (t.points.size() < 300) {
        report.warnings.push_back(text("only %ld readings: 500 or more make the fit trustworthy",
                                       static_cast<long>(t.points.size())));
    }
    if (fit.coverage < 0.5) {
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

}  // namespace

StageReport align_report(const FitContext& s,
                         const PoseChoice& choice,
                         const FitMeasure& fit,
                         double seconds) {
    StageReport report;
    report.stage = "align";
    report.version = kRegisterVersion;
    report.seconds = seconds;
    add_target(report, s.target);
    add_fit(report, "rigid", fit);
    report.measures.push_back({"pose_score_mm", choice.best.score_mm});
    report.measures.push_back({"mirror_score_mm", choice.mirror_score_mm});
    report.measures.push_back({"open_side_size", s.open_side.size});
    if (choice.open_side_dropped) {
        report.notes = {
            {"open_side", "none"},
            {"open_side_reason", "the sweep is of a flank, which says nothing of the back"}};
    } else {
        report.notes = {{"open_side", s.open_side_is}, {"open_side_reason", s.open_side_why}};
    }
    if (!choice.runners_up.empty()) {
        const RunnerUp& r = choice.runners_up.front();
        report.measures.push_back({"runner_up_score_mm", r.score_mm});
        report.measures.push_back({"runner_up_turn_deg", r.turn_deg});
        report.measures.push_back({"runner_up_shift_mm", r.shift_mm});
        report.measures.push_back({"runner_up_coverage", r.coverage});
    }
    report.warnings = choice.warnings;
    return report;
}

StageReport warp_report(const FitContext& s,
                        const WarpFit& w,
                        const RegisterOptions& options,
                        double seconds) {
    StageReport report;
    report.stage = "warp";
    report.version = kRegisterVersion;
    report.seconds = seconds;
    add_fit(report, "skin", w.fit);
    report.measures.push_back({"min_det_jacobian", w.least_det});
    report.measures.push_back({"sampled_min_det_jacobian", w.sampled_det});
    report.measures.push_back({"skin_bias_mm", w.fit.mean_signed_mm});
    report.measures.push_back({"skin_coverage", w.fit.skin_coverage});
    report.measures.push_back({"skin_behind_table_mm", w.fit.behind_table_mm});
    report.measures.push_back({"counterparts", static_cast<double>(w.fit.counterparts)});
    report.measures.push_back({"unexplained_readings", static_cast<double>(w.fit.unexplained)});
    add_fit(report, "quadratic", w.quadratic_fit);
    report.measures.push_back({"consensus", w.ransac.consensus});
    report.measures.push_back({"rigid_consensus", w.ransac.rigid_consensus});
    report.measures.push_back({"consensus_mm", w.ransac.consensus_mm});
    report.measures.push_back({"folding_trials", static_cast<double>(w.ransac.folding_trials)});
    report.measures.push_back({"constraint_mm", w.constraint_mm});
    report.measures.push_back({"quadratic_condition", w.condition});
    report.measures.push_back({"gap_standard_error_mm", w.trust.standard_error_mm});
    report.measures.push_back({"held_out_mm", w.trust.held_out_mm});
    report.measures.push_back({"rigid_held_out_mm", w.rigid_trust.fitted_mm});
    report.measures.push_back({"predicted_interior_mm", w.trust.inside_mm});
    report.measures.push_back({"residual_warp", w.residual.used ? 1.0 : 0.0});
    report.measures.push_back({"residual_bending", w.residual.used ? w.residual.bending : 0.0});
    report.measures.push_back({"residual_mean_mm", w.residual_mean_mm});
    report.measures.push_back(
        {"residual_interior_move_mm", w.residual.used ? w.residual.inside_mm : 0.0});
    report.measures.push_back({"residual_iterations", static_cast<double>(w.residual.iterations)});
    report.measures.push_back({"least_minor", w.one_to_one.least_minor()});
    report.measures.push_back({"elastic_stiffness", w.stiffness});
    report.measures.push_back({"elastic_refits", static_cast<double>(w.elastic_refits)});
    report.measures.push_back({"elastic_strain_mm2", w.elastic.strain_mm2});
    report.measures.push_back({"elastic_iterations", static_cast<double>(w.elastic.iterations)});
    report.notes = {{"path", w.path}, {"path_reason", w.reason}};
    if (!w.organs.empty()) add_organs(report, w.organs);
    report.warnings = w.warnings;
    warn_of_readings(report, s, w.fit);
    warn_of_landmarks(report, options, w);
    return report;
}

}  // namespace sonocase::pipeline
