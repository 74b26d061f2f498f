#include "pipeline/registration/register_surfaces.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>

#include "pipeline/parallel.h"
#include "pipeline/registration/fold_proof.h"

namespace sonocase::pipeline {
namespace {

constexpr double kDegree = 3.14159265358979323846 / 180;
constexpr double kFineSkin_mm = 6, kCoarseSkin_mm = 13;
// Candidates are judged after a quadratic of this stiffness, by gaps with this Cauchy scale; what
// has no counterpart costs as much as this gap.
constexpr double kJudgeConstraint_mm = 10, kJudgeScale_mm = 5, kNoCounterpart_mm = 12;
// A constraint weight is tried only while it is at least this many robust spreads of the gaps: a
// lighter one would only bend to what no quadratic can follow.
constexpr double kFreedom = 0.75;
constexpr double kCloseScore = 1.10;

std::string text(const char* format, auto... values) {
    char line[400];
    std::snprintf(line, sizeof line, format, values...);
    return line;
}

double seconds_since(std::chrono::steady_clock::time_point start) {
    return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

// Everything that the stages share.
struct Setting {
    const SkinSurfaceResult& skin;
    TargetSurface target;
    SkinModel fine, coarse;
    Box3 box;  // ct, less the skin's origin
    PoseHints hints;
    std::vector<Correspondence> landmarks;
    std::vector<std::uint32_t> readings;
};

Result<Setting> prepare(const RegisterInput& input, const RegisterOptions& options) {
    Result<TargetSurface> target = prepare_target(input.mannequin, options.target);
    if (!target) return target.error();
    Setting s{input.skin, std::move(*target), {}, {}, {}, {}, {}, {}};
    const Point3 origin = input.skin.box.centre();
    s.fine = thin_skin(input.skin.skin, input.skin.on_rim, origin, kFineSkin_mm);
    s.coarse = thin_skin(input.skin.skin, input.skin.on_rim, origin, kCoarseSkin_mm);
    s.box.include(Point3{} + (input.skin.box.lower - origin));
    s.box.include(Point3{} + (input.skin.box.upper - origin));
    s.readings = thin_target(s.target, 0);
    if (options.up) {
        const double length = norm(*options.up);
        if (!(length > 1e-6) || !std::isfinite(length)) {
            return Error{"the up direction has no length", "--up",
                         "give the patient's head direction in the surface's frame, e.g. 0,1,0"};
        }
        s.hints.up = *options.up / length;
    }
    for (const Landmark& mark : options.landmarks) {
        if (!std::isfinite(norm(mark.ct - Point3{})) ||
            !std::isfinite(norm(mark.mannequin - Point3{}))) {
            return Error{"landmark '" + mark.name + "' is not finite", "--landmarks",
                         "rows are name,ct_x,ct_y,ct_z,x,y,z in mm"};
        }
        const Point3 a = Point3{} + (mark.ct - origin);
        const Point3 b = Point3{} + (mark.mannequin - s.target.origin);
        s.hints.landmarks.push_back({a, b});
        s.landmarks.push_back({a, b});
    }
    return s;
}

Registration in_frames(const Setting& s, const RigidQuadratic& q) {
    Registration r;
    r.quadratic = in_frames(q, s.fine.origin, s.target.origin);
    r.ct_box = s.skin.box;
    r.mannequin_from_ct.rotation = q.rigid.rotation;
    r.mannequin_from_ct.translation = (s.target.origin - Point3{}) + q.rigid.translation -
                                      q.rigid.rotation * (s.fine.origin - Point3{});
    return r;
}

struct Judged {
    RigidCandidate rigid;
    RigidQuadratic quadratic;
    double score_mm = 0, coverage = 0;
};

double penalty(double gap) {
    return kJudgeScale_mm * kJudgeScale_mm *
           std::log1p(gap * gap / (kJudgeScale_mm * kJudgeScale_mm));
}

// A candidate after a stiff quadratic and a coarse field: gaps, missing counterparts, deformation
// and hints together.
Judged judge(const Setting& s, const TargetSurface& target, const RigidCandidate& rigid) {
    Judged judged;
    judged.rigid = rigid;
    judged.quadratic = RigidQuadratic::from_rigid(rigid.target_from_skin);
    std::vector<std::uint32_t> readings = thin_target(target, 1.2 * target.spacing_mm);
    if (readings.size() > 900) {
        std::vector<std::uint32_t> fewer;
        for (std::size_t n = 0; n < 900; ++n) fewer.push_back(readings[n * readings.size() / 900]);
        readings = std::move(fewer);
    }
    RefineOptions options;
    options.skin_askers = 900;
    options.landmarks = s.landmarks;
    options.landmark_weight = s.hints.landmark_weight;
    double deformation = 0;
    for (double constraint : {3 * kJudgeConstraint_mm, kJudgeConstraint_mm}) {
        options.constraint_mm = constraint;
        options.iterations = 5;
        const RefineResult refined =
            refine_quadratic(s.coarse, target, readings, judged.quadratic, options);
        judged.quadratic = refined.map;
        deformation = refined.constraint_cost;
        options.first_loss_mm = 5;
    }
    // What it would still cost to bend the skin all the way: a coarse residual field.
    ResidualOptions field;
    field.spacing_mm = 45;
    field.rounds = 3;
    field.tolerance = 1e-2;
    field.skin_askers = 900;
    Registration map;
    map.quadratic = in_frames(judged.quadratic, s.coarse.origin, target.origin);
    map.ct_box = s.skin.box;
    const FieldFit fit = fit_field(s.coarse, target, readings, field, &map);
    const auto mean = [](const std::vector<Match>& list, std::size_t asked) {
        double sum = 0;
        for (const Match& m : list) sum += penalty(m.gap_mm);
        const auto count = static_cast<double>(std::max<std::size_t>(1, asked));
        return (sum + (count - static_cast<double>(list.size())) * penalty(kNoCounterpart_mm)) /
               count;
    };
    const Matches& matches = fit.matches;
    const double gaps = 0.5 * mean(matches.from_target, matches.target_asked) +
                        0.5 * mean(matches.from_skin, matches.skin_asked);
    double hints = 0;
    for (const Correspondence& c : s.landmarks) {
        const Vector3 r = map_point(judged.quadratic, c.skin) - c.place;
        hints += s.hints.landmark_weight * std::min(dot(r, r), 60.0 * 60.0);
    }
    if (s.hints.up) {
        const Vector3 r = rigid.target_from_skin.rotation.column(2) - *s.hints.up;
        hints += s.hints.up_weight_mm2 * dot(r, r);
    }
    judged.score_mm = std::sqrt(gaps + 0.5 * deformation + fit.energy_mm2 + hints);
    judged.coverage = static_cast<double>(matches.from_target.size()) /
                      static_cast<double>(std::max<std::size_t>(1, matches.target_asked));
    return judged;
}

// How another pose differs from the chosen one, in a word that a case author understands.
RunnerUp described(const Judged& best, const Judged& other) {
    RunnerUp r;
    r.score_mm = other.score_mm;
    r.coverage = other.coverage;
    const Rigid &a = best.rigid.target_from_skin, &b = other.rigid.target_from_skin;
    r.turn_deg = rotation_angle(transpose(a.rotation) * b.rotation) / kDegree;
    r.shift_mm = norm(a.translation - b.translation);
    const double head = dot(a.rotation.column(2), b.rotation.column(2));
    const double front = dot(a.rotation.column(1), b.rotation.column(1));
    if (head < -0.5) {
        r.described = front < -0.5 ? "upside down and front to back" : "upside down";
    } else if (r.turn_deg < 25) {
        r.described = text("shifted by %.0f mm", r.shift_mm);
    } else if (head > 0.7 && front < -0.5) {
        r.described = "turned front to back";
    } else if (head > 0.7) {
        r.described = text("turned by %.0f degrees about the body's length", r.turn_deg);
    } else {
        r.described = text("turned by %.0f degrees", r.turn_deg);
    }
    return r;
}

// The target seen in a mirror that stands in the patient's middle plane.
TargetSurface mirrored(const TargetSurface& target, const Rigid& pose) {
    TargetSurface m;
    m.origin = target.origin;
    const Vector3 across = pose.rotation.column(0);
    const Vector3 middle = pose.translation;
    for (Point3 p : target.points) {
        const double d = dot(across, (p - Point3{}) - middle);
        m.points.push_back(p - 2 * d * across);
    }
    for (Vector3 n : target.normals) m.normals.push_back(n - 2 * dot(n, across) * across);
    m.on_rim = target.on_rim;
    m.lifted = target.lifted;
    m.spacing_mm = target.spacing_mm;
    m.index = PointIndex(m.points);
    return m;
}

struct Aligned {
    Judged best;
    std::vector<RunnerUp> runners_up;
    double mirror_score_mm = 0;
    std::vector<std::string> warnings;
};

Aligned align(const Setting& s, const RegisterOptions& options, const Progress& progress) {
    RigidOptions rigid = options.rigid;
    rigid.hints = s.hints;
    rigid.seed = options.seed;
    tell(progress, 0.05, "rigid alignment: starts");
    std::vector<RigidCandidate> candidates =
        align_rigid_candidates(s.coarse, s.target, rigid, progress);
    tell(progress, 0.2, "rigid alignment: judging candidates");
    std::vector<Judged> judged(candidates.size());
    parallel_for(candidates.size(), 1, [&](std::size_t begin, std::size_t end) {
        for (std::size_t n = begin; n < end; ++n) judged[n] = judge(s, s.target, candidates[n]);
    });
    std::stable_sort(judged.begin(), judged.end(),
                     [](const Judged& a, const Judged& b) { return a.score_mm < b.score_mm; });
    Aligned aligned;
    aligned.best = judged[0];
    for (std::size_t n = 1; n < judged.size(); ++n) {
        aligned.runners_up.push_back(described(judged[0], judged[n]));
    }
    const std::string hint =
        s.hints.up ? (s.landmarks.empty()
                          ? "add two landmarks such as crotch and navel (--landmarks FILE.csv)"
                          : "add landmarks that lie far apart")
                   : "give the patient's head direction in the surface's frame (--up X,Y,Z) or two "
                     "landmarks such as crotch and navel (--landmarks FILE.csv)";
    for (const RunnerUp& r : aligned.runners_up) {
        if (r.score_mm > kCloseScore * judged[0].score_mm) break;
        aligned.warnings.push_back(
            text("ambiguous pose: a fit %s scores %.2f mm against %.2f mm of the one chosen; %s",
                 r.described.c_str(), r.score_mm, judged[0].score_mm, hint.c_str()));
        break;
    }
    // A mirrored surface (left-handed axes) fits a nearly symmetric torso almost as well.
    const TargetSurface mirror = mirrored(s.target, judged[0].rigid.target_from_skin);
    const Judged other =
        judge(s, mirror, refine_rigid(s.coarse, mirror, judged[0].rigid.target_from_skin, rigid));
    aligned.mirror_score_mm = other.score_mm;
    if (other.score_mm * kCloseScore < judged[0].score_mm) {
        aligned.warnings.push_back(
            text("the surface looks like a mirror image of the patient (%.2f mm mirrored against "
                 "%.2f mm "
                 "as given): check that its axes are right-handed",
                 other.score_mm, judged[0].score_mm));
    }
    return aligned;
}

struct Warped {
    Registration registration;
    RansacResult ransac;
    double constraint_mm = 0;  // of the weight taken; 0: none, the map is RANSAC's or rigid
    double condition = 0;
    double least_det = 1, sampled_det = 1;
    ResidualReport residual;
    FitMeasure rigid_fit, quadratic_fit, fit;
    double residual_mean_mm = 0;
    std::vector<std::string> warnings;
};

// Robust spread of the gaps of a map, and their cost for comparison between maps.
struct GapSpread {
    double sigma_mm = 0, cost = 0;
};
GapSpread spread_of(const Setting& s, const RigidQuadratic& q) {
    const MappedSkin mapped = map_skin(s.fine, q);
    MatchOptions gates;
    gates.farthest_mm = 40;
    gates.side_step_mm = 1.2 * s.target.spacing_mm;
    const Matches m = find_matches(s.fine, mapped.points, mapped.normals, mapped.index, s.target,
                                   s.readings, 4, gates);
    std::vector<double> gaps;
    GapSpread spread;
    for (const auto* list : {&m.from_target, &m.from_skin}) {
        const std::size_t asked = list == &m.from_target ? m.target_asked : m.skin_asked;
        double sum = 0;
        for (const Match& match : *list) {
            gaps.push_back(std::abs(match.gap_mm));
            sum += penalty(match.gap_mm);
        }
        const auto count = static_cast<double>(std::max<std::size_t>(1, asked));
        spread.cost +=
            0.5 * (sum + (count - static_cast<double>(list->size())) * penalty(kNoCounterpart_mm)) /
            count;
    }
    if (!gaps.empty()) {
        std::nth_element(gaps.begin(), gaps.begin() + static_cast<std::ptrdiff_t>(gaps.size() / 2),
                         gaps.end());
        spread.sigma_mm = 1.4826 * gaps[gaps.size() / 2];
    }
    return spread;
}

Warped warp(const Setting& s,
            const Rigid& rigid,
            const RegisterOptions& options,
            const Progress& progress) {
    Warped w;
    const RigidQuadratic start = RigidQuadratic::from_rigid(rigid);
    w.rigid_fit = measure_fit(s.skin, s.target, in_frames(s, start));
    RansacOptions ransac = options.ransac;
    ransac.seed = options.seed;
    tell(progress, 0.4, "quadratic warp: trials");
    w.ransac = ransac_quadratic(s.fine, s.target, rigid, s.box, ransac, progress);
    RigidQuadratic q = w.ransac.map;
    if (!options.paper_warp) {
        // The trials' answer is a start like the rigid one; the better of both after a stiff fit
        // wins.
        RefineOptions refine;
        refine.landmarks = s.landmarks;
        refine.landmark_weight = s.hints.landmark_weight;
        GapSpread spread = spread_of(s, q);
        if (const GapSpread rigid_spread = spread_of(s, start);
            !(spread.cost < rigid_spread.cost)) {
            q = start;
            spread = rigid_spread;
        }
        bool first = true;
        for (double constraint : options.constraint_mm) {
            tell(progress, 0.55, "quadratic warp: point to surface");
            // Freedom is earned: a weight below the gaps themselves only fits what no quadratic
            // can.
            if (!first && constraint < kFreedom * spread.sigma_mm) break;
            refine.constraint_mm = constraint;
            refine.iterations = first ? 7 : 6;
            const RefineResult refined = refine_quadratic(s.fine, s.target, s.readings, q, refine);
            const double det = proven_min_det(refined.map, s.box);
            const GapSpread next = spread_of(s, refined.map);
            if (!(det >= options.wanted_det)) break;
            if (!first && !(next.cost < 1.02 * spread.cost)) break;
            q = refined.map;
            spread = next;
            w.constraint_mm = constraint;
            w.condition = refined.condition;
            refine.first_loss_mm = 4;
            refine.first_gate_mm = 40;
            first = false;
        }
    }
    w.registration = in_frames(s, q);
    FoldProof proof = prove_no_fold(w.registration);
    w.registration.min_det_jacobian = proof.least_bound;
    w.quadratic_fit = measure_fit(s.skin, s.target, w.registration);
    if (options.residual_warp && !options.paper_warp) {
        tell(progress, 0.7, "residual warp");
        w.residual =
            fit_residual(s.fine, s.target, s.readings, options.residual, &w.registration, progress);
        if (w.residual.used) {
            proof = prove_no_fold(w.registration);
            double sum = 0;
            const auto& field = w.registration.residual;
            for (Point3 p : s.coarse.points) {
                sum += norm(displacement(field, s.coarse.origin + (p - Point3{})));
            }
            w.residual_mean_mm = sum / static_cast<double>(s.coarse.points.size());
        } else if (w.residual.least_det != 0) {
            w.warnings.push_back(text("no residual warp: %s (least det J %.2f)", w.residual.reason,
                                      w.residual.least_det));
        }
    }
    w.least_det = w.registration.min_det_jacobian = proof.least_bound;
    w.sampled_det = proof.least_sample;
    w.fit = w.residual.used ? measure_fit(s.skin, s.target, w.registration) : w.quadratic_fit;
    tell(progress, 0.95, "measuring");
    if (!(w.least_det > kLeastDetJacobian)) {
        w.warnings.push_back(
            text("the map is not proven free of folds (det J >= %.3f)", w.least_det));
    }
    return w;
}

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
    report.measures.push_back({"reading_spacing_mm", t.spacing_mm});
}

void warn_of_readings(StageReport& report, const Setting& s, const FitMeasure& fit) {
    const TargetSurface& t = s.target;
    if (t.not_finite > 0) {
        report.warnings.push_back(
            text("%ld rows of the surface are not finite and were left out", t.not_finite));
    }
    if (t.lift_offs > static_cast<long>(t.points.size()) / 10) {
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

StageReport align_report(const Setting& s,
                         const Aligned& aligned,
                         const FitMeasure& fit,
                         double seconds) {
    StageReport report;
    report.stage = "align";
    report.version = kRegisterVersion;
    report.seconds = seconds;
    add_target(report, s.target);
    add_fit(report, "rigid", fit);
    report.measures.push_back({"pose_score_mm", aligned.best.score_mm});
    report.measures.push_back({"mirror_score_mm", aligned.mirror_score_mm});
    if (!aligned.runners_up.empty()) {
        const RunnerUp& r = aligned.runners_up.front();
        report.measures.push_back({"runner_up_score_mm", r.score_mm});
        report.measures.push_back({"runner_up_turn_deg", r.turn_deg});
        report.measures.push_back({"runner_up_shift_mm", r.shift_mm});
        report.measures.push_back({"runner_up_coverage", r.coverage});
    }
    report.warnings = aligned.warnings;
    return report;
}

StageReport warp_report(const Setting& s, const Warped& w, double seconds) {
    StageReport report;
    report.stage = "warp";
    report.version = kRegisterVersion;
    report.seconds = seconds;
    add_fit(report, "skin", w.fit);
    report.measures.push_back({"min_det_jacobian", w.least_det});
    report.measures.push_back({"sampled_min_det_jacobian", w.sampled_det});
    report.measures.push_back({"skin_bias_mm", w.fit.mean_signed_mm});
    report.measures.push_back({"skin_coverage", w.fit.skin_coverage});
    report.measures.push_back({"counterparts", static_cast<double>(w.fit.counterparts)});
    report.measures.push_back({"unexplained_readings", static_cast<double>(w.fit.unexplained)});
    add_fit(report, "quadratic", w.quadratic_fit);
    report.measures.push_back({"consensus", w.ransac.consensus});
    report.measures.push_back({"rigid_consensus", w.ransac.rigid_consensus});
    report.measures.push_back({"consensus_mm", w.ransac.consensus_mm});
    report.measures.push_back({"folding_trials", static_cast<double>(w.ransac.folding_trials)});
    report.measures.push_back({"constraint_mm", w.constraint_mm});
    report.measures.push_back({"quadratic_condition", w.condition});
    report.measures.push_back({"residual_warp", w.residual.used ? 1.0 : 0.0});
    report.measures.push_back({"residual_bending", w.residual.used ? w.residual.bending : 0.0});
    report.measures.push_back({"residual_mean_mm", w.residual_mean_mm});
    report.measures.push_back({"residual_iterations", static_cast<double>(w.residual.iterations)});
    report.warnings = w.warnings;
    warn_of_readings(report, s, w.fit);
    return report;
}

void warn_of_landmarks(StageReport& report, const RegisterOptions& options, const Registration& r) {
    for (const Landmark& mark : options.landmarks) {
        const double off = distance(mannequin_from_ct(r, mark.ct), mark.mannequin);
        if (off > 30) {
            report.warnings.push_back(
                text("landmark '%s' ends %.0f mm from its place: check its coordinates",
                     mark.name.c_str(), off));
        }
    }
}

}  // namespace

Result<RegisterResult> align_surfaces(const RegisterInput& input,
                                      const RegisterOptions& options,
                                      const Progress& progress) {
    const auto start = std::chrono::steady_clock::now();
    Result<Setting> s = prepare(input, options);
    if (!s) return s.error();
    const Aligned aligned = align(*s, options, progress);
    const Rigid pose = refine_rigid_robust(s->fine, s->target, aligned.best.rigid.target_from_skin,
                                           s->hints, 6, 4);
    RegisterResult result;
    result.registration = in_frames(*s, RigidQuadratic::from_rigid(pose));
    result.registration.min_det_jacobian = 1;
    result.rigid_fit = result.quadratic_fit = result.fit =
        measure_fit(s->skin, s->target, result.registration);
    result.runners_up = aligned.runners_up;
    result.report = align_report(*s, aligned, result.fit, seconds_since(start));
    result.registration.reports = {result.report};
    return result;
}

Result<RegisterResult> warp_surfaces(const RegisterInput& input,
                                     const Rigid& mannequin_from_ct,
                                     const RegisterOptions& options,
                                     const Progress& progress) {
    const auto start = std::chrono::steady_clock::now();
    Result<Setting> s = prepare(input, options);
    if (!s) return s.error();
    const Rigid pose{mannequin_from_ct.rotation,
                     mannequin_from_ct * s->fine.origin - s->target.origin};
    const Warped w = warp(*s, pose, options, progress);
    RegisterResult result;
    result.registration = w.registration;
    result.rigid_fit = w.rigid_fit;
    result.quadratic_fit = w.quadratic_fit;
    result.fit = w.fit;
    result.report = warp_report(*s, w, seconds_since(start));
    warn_of_landmarks(result.report, options, result.registration);
    result.registration.reports = {result.report};
    return result;
}

Result<RegisterResult> register_surfaces(const RegisterInput& input,
                                         const RegisterOptions& options,
                                         const Progress& progress) {
    const auto start = std::chrono::steady_clock::now();
    Result<RegisterResult> aligned = align_surfaces(input, options, progress);
    if (!aligned) return aligned.error();
    Result<RegisterResult> warped =
        warp_surfaces(input, aligned->registration.mannequin_from_ct, options, progress);
    if (!warped) return warped.error();
    RegisterResult result = std::move(*warped);
    result.runners_up = aligned->runners_up;
    const StageReport align_stage = aligned->report, warp_stage = result.report;
    result.registration.reports = {align_stage, warp_stage};
    result.report = warp_stage;
    result.report.stage = "register";
    result.report.measures.insert(result.report.measures.end(), align_stage.measures.begin(),
                                  align_stage.measures.end());
    result.report.warnings.insert(result.report.warnings.begin(), align_stage.warnings.begin(),
                                  align_stage.warnings.end());
    result.report.measures.push_back({"align_seconds", align_stage.seconds});
    result.report.measures.push_back({"warp_seconds", warp_stage.seconds});
    result.report.seconds = seconds_since(start);
    tell(progress, 1, "done");
    return result;
}

}  // namespace sonocase::pipeline
