// SPDX-License-Identifier: Apache-2.0

#include "pipeline/registration/pose_choice.h"

#include <algorithm>
#include <cmath>

#include "formats/base/constants.h"
#include "pipeline/base/parallel.h"
#include "pipeline/base/text.h"

namespace sonocase::pipeline::inline registration {
namespace {

// Candidates are compared after a quadratic of this stiffness, by gaps with this Cauchy scale; a
// point without a counterpart costs as much as this gap.
constexpr double kJudgeConstraintMm = 10, kJudgeScaleMm = 5, kNoCounterpartMm = 12;
constexpr double kCloseScore = 1.10, kQuarterTurn = 1.25;

double penalty(double gap) {
    return kJudgeScaleMm * kJudgeScaleMm * std::log1p(gap * gap / (kJudgeScaleMm * kJudgeScaleMm));
}

// A candidate after a stiff quadratic and a coarse field; its score sums the costs of gaps, missing
// counterparts, deformation and hints.
JudgedPose judge(const FitContext& s, const TargetSurface& target, const RigidCandidate& rigid) {
    JudgedPose judged;
    judged.rigid = rigid;
    judged.quadratic = RigidQuadratic::from_rigid(rigid.target_from_skin);
    std::vector<std::uint32_t> readings = thin_target(target, 1.2 * target.spacing_mm);
    if (readings.size() > 900) {
        std::vector<std::uint32_t> fewer;
        for (std::size_t n = 0; n < 900; ++n) fewer.push_back(readings[n * readings.size() / 900]);
        readings = std::move(fewer);
    }
    RefineOptions options;
    options.skin_queries = 900;
    options.landmarks = s.landmarks;
    options.landmark_weight = s.hints.landmark_weight;
    double deformation = 0;
    for (double constraint : {3 * kJudgeConstraintMm, kJudgeConstraintMm}) {
        options.constraint_mm = constraint;
        options.iterations = 5;
        const RefineResult refined =
            refine_quadratic(s.coarse, target, readings, judged.quadratic, options);
        judged.quadratic = refined.map;
        deformation = refined.constraint_cost;
        options.first_loss_mm = 5;
    }
    // The remaining cost of deforming the skin onto the mannequin: a coarse residual field.
    ResidualOptions field;
    field.spacing_mm = 45;
    field.rounds = 3;
    field.tolerance = 1e-2;
    field.skin_queries = 900;
    Registration map;
    map.quadratic = in_frames(judged.quadratic, s.coarse.origin, target.origin);
    map.ct_box = s.skin.box;
    const FieldFit fit = fit_field(s.coarse, target, readings, field, &map);
    const auto mean = [](const std::vector<Match>& list, std::size_t queries) {
        double sum = 0;
        for (const Match& m : list) sum += penalty(m.gap_mm);
        const auto count = static_cast<double>(std::max<std::size_t>(1, queries));
        return (sum + (count - static_cast<double>(list.size())) * penalty(kNoCounterpartMm)) /
               count;
    };
    const Matches& matches = fit.matches;
    const double gaps = 0.5 * mean(matches.from_target, matches.target_queries) +
                        0.5 * mean(matches.from_skin, matches.skin_queries);
    judged.back_cost_mm2 = s.hints.back_cost_mm2(rigid.target_from_skin);
    double hints = judged.back_cost_mm2;
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
                      static_cast<double>(std::max<std::size_t>(1, matches.target_queries));
    return judged;
}

// A sweep of one flank is open towards the other. Taken for the back, that would roll the patient
// by a quarter turn, which, unlike a half turn, fits clearly worse: then the open side says
// nothing.
bool drop_open_side(const FitContext& s,
                    const RegisterOptions& options,
                    std::vector<JudgedPose>& judged) {
    if (!s.hints.back || options.open_side != "auto" || s.target.table.found) return false;
    const auto bare = [](const JudgedPose& p) {
        return std::sqrt(std::max(0.0, p.score_mm * p.score_mm - p.back_cost_mm2));
    };
    const JudgedPose *with = &judged[0], *without = &judged[0];
    for (const JudgedPose& p : judged) {
        if (p.score_mm < with->score_mm) with = &p;
        if (bare(p) < bare(*without)) without = &p;
    }
    const auto front = [](const JudgedPose& p) {
        return p.rigid.target_from_skin.rotation.column(1);
    };
    const bool followed = std::abs(dot(front(*with), *s.hints.back)) > 0.7;
    const bool turned = std::abs(dot(front(*with), front(*without))) < 0.7;
    if (followed && (!turned || bare(*with) < kQuarterTurn * bare(*without))) return false;
    for (JudgedPose& p : judged) {
        p.score_mm = bare(p);
        p.back_cost_mm2 = 0;
    }
    return true;
}

// How another pose differs from the chosen one, in terms that a case author understands.
RunnerUp described(const JudgedPose& best, const JudgedPose& other) {
    RunnerUp r;
    r.score_mm = other.score_mm;
    r.coverage = other.coverage;
    const Rigid &a = best.rigid.target_from_skin, &b = other.rigid.target_from_skin;
    r.turn_deg = rotation_angle(transpose(a.rotation) * b.rotation) / kRadPerDeg;
    r.shift_mm = norm(a.translation - b.translation);
    const double head = dot(a.rotation.column(2), b.rotation.column(2));
    const double front = dot(a.rotation.column(1), b.rotation.column(1));
    if (head < -0.5) {
        r.kind = PoseKind::upside_down;
        r.described = front < -0.5 ? "upside down and front to back" : "upside down";
    } else if (r.turn_deg < 25) {
        r.kind = PoseKind::shifted;
        r.described = text("shifted by %.0f mm", r.shift_mm);
    } else if (head > 0.7 && front < -0.5) {
        r.kind = PoseKind::rolled;
        r.described = "turned front to back";
    } else if (head > 0.7) {
        r.kind = PoseKind::rolled;
        r.described = text("rolled by %.0f degrees about the body's length", r.turn_deg);
    } else {
        r.kind = PoseKind::tilted;
        r.described = text("tilted by %.0f degrees", r.turn_deg);
    }
    return r;
}

// One warning per kind of pose that the surfaces cannot rule out, with the hint that can.
void warn_of_runners_up(const FitContext& s, PoseChoice* choice) {
    std::vector<PoseKind> told;
    for (const RunnerUp& r : choice->runners_up) {
        if (r.score_mm > kCloseScore * choice->best.score_mm) break;
        if (std::find(told.begin(), told.end(), r.kind) != told.end()) continue;
        told.push_back(r.kind);
        const char* hint = "add landmarks that lie far apart (--landmarks FILE.csv)";
        if (r.kind == PoseKind::upside_down && !s.hints.up) {
            hint =
                "give the patient's head direction in the surface's frame (--up X,Y,Z) or two "
                "landmarks such as crotch and navel (--landmarks FILE.csv)";
        } else if (r.kind == PoseKind::rolled && s.landmarks.empty()) {
            hint =
                "give a landmark on the front, such as the navel, and one on the back "
                "(--landmarks FILE.csv)";
        } else if (r.kind == PoseKind::shifted && s.landmarks.empty()) {
            hint = "give a landmark low on the body, such as the crotch (--landmarks FILE.csv)";
        } else if (r.kind == PoseKind::tilted && !s.hints.up) {
            hint = "give the patient's head direction in the surface's frame (--up X,Y,Z)";
        }
        choice->warnings.push_back(
            text("ambiguous pose: a fit %s scores %.2f mm against %.2f mm of the one chosen; %s",
                 r.described.c_str(), r.score_mm, choice->best.score_mm, hint));
    }
}

// The target mirrored in the patient's median plane.
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

}  // namespace

PoseChoice choose_pose(const FitContext& s,
                       const RegisterOptions& options,
                       const Progress& progress) {
    RigidOptions rigid = options.rigid;
    rigid.hints = s.hints;
    rigid.seed = options.seed;
    report_progress(progress, 0.05, "rigid alignment: starts");
    std::vector<RigidCandidate> candidates =
        align_rigid_candidates(s.coarse, s.target, rigid, progress);
    report_progress(progress, 0.2, "rigid alignment: judging candidates");
    std::vector<JudgedPose> judged(candidates.size());
    parallel_for(candidates.size(), 1, [&](std::size_t begin, std::size_t end) {
        for (std::size_t n = begin; n < end; ++n) judged[n] = judge(s, s.target, candidates[n]);
    });
    PoseChoice choice;
    choice.open_side_dropped = drop_open_side(s, options, judged);
    std::stable_sort(judged.begin(), judged.end(), [](const JudgedPose& a, const JudgedPose& b) {
        return a.score_mm < b.score_mm;
    });
    choice.best = judged[0];
    for (std::size_t n = 1; n < judged.size(); ++n) {
        choice.runners_up.push_back(described(judged[0], judged[n]));
    }
    warn_of_runners_up(s, &choice);
    // A mirrored surface (left-handed axes) also fits a symmetric torso: warn only if the mirrored
    // one fits clearly better.
    const TargetSurface mirror = mirrored(s.target, judged[0].rigid.target_from_skin);
    const JudgedPose other =
        judge(s, mirror, refine_rigid(s.coarse, mirror, judged[0].rigid.target_from_skin, rigid));
    choice.mirror_score_mm = other.score_mm;
    if (other.score_mm * kCloseScore < judged[0].score_mm) {
        choice.warnings.push_back(
            text("the surface looks like a mirror image of the patient: it fits to %.2f mm in a "
                 "mirror and to %.2f mm as given; check that its axes are right-handed",
                 other.score_mm, judged[0].score_mm));
    }
    return choice;
}

}  // namespace sonocase::pipeline::inline registration
