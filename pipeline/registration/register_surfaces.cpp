// SPDX-License-Identifier: Apache-2.0

#include "pipeline/registration/register_surfaces.h"

#include <chrono>

#include "pipeline/registration/register_report.h"

namespace sonocase::pipeline {
namespace {

double seconds_since(std::chrono::steady_clock::time_point start) {
    return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

RegisterResult align(const FitContext& s,
                     const RegisterOptions& options,
                     std::chrono::steady_clock::time_point start,
                     const Progress& progress) {
    const PoseChoice choice = choose_pose(s, options, progress);
    const Rigid pose =
        refine_rigid_robust(s.fine, s.target, choice.best.rigid.target_from_skin, s.hints, 6, 4);
    RegisterResult result;
    result.registration = in_frames(s, RigidQuadratic::from_rigid(pose));
    result.registration.min_det_jacobian = 1;
    result.rigid_fit = result.quadratic_fit = result.fit =
        measure_fit(s.skin, s.target, result.registration);
    result.runners_up = choice.runners_up;
    result.report = align_report(s, choice, result.fit, seconds_since(start));
    result.registration.reports = {result.report};
    return result;
}

RegisterResult warp(const FitContext& s,
                    const Rigid& mannequin_from_ct,
                    const RegisterOptions& options,
                    std::chrono::steady_clock::time_point start,
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
    result.report = warp_report(s, w, options, seconds_since(start));
    result.registration.reports = {result.report};
    return result;
}

}  // namespace

Result<RegisterResult> align_surfaces(const RegisterInput& input,
                                      const RegisterOptions& options,
                                      const Progress& progress) {
    const auto start = std::chrono::steady_clock::now();
    Result<FitContext> s = prepare_fit(input, options);
    if (!s) return s.error();
    return align(*s, options, start, progress);
}

Result<RegisterResult> warp_surfaces(const RegisterInput& input,
                                     const Rigid& mannequin_from_ct,
                                     const RegisterOptions& options,
                                     const Progress& progress) {
    const auto start = std::chrono::steady_clock::now();
    Result<FitContext> s = prepare_fit(input, options);
    if (!s) return s.error();
    return warp(*s, mannequin_from_ct, options, start, progress);
}

Result<RegisterResult> register_surfaces(const RegisterInput& input,
                                         const RegisterOptions& options,
                                         const Progress& progress) {
    const auto start = std::chrono::steady_clock::now();
    Result<FitContext> s = prepare_fit(input, options);
    if (!s) return s.error();
    const RegisterResult aligned = align(*s, options, start, progress);
    RegisterResult result = warp(*s, aligned.registration.mannequin_from_ct, options,
                                 std::chrono::steady_clock::now(), progress);
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
    result.report.seconds = seconds_since(start);
    report_progress(progress, 1, "done");
    return result;
}

}  // namespace sonocase::pipeline
