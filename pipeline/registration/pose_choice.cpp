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
constexpr double kCloseScore = 1.10, kQuarterTurn = 1.25, kQuarterTurnCosine = 0.7;
// Bodies whose skin has no right and left fit their mirror image within 3 % either way; those whose
// skin has fit it 15 % worse or more. Halves and quarters of right-handed bodies fit 4 % better to
// 18 % worse in the mirror, and of left-handed ones 10 % better to 19 % worse.
constexpr double kMirrorScore = 1.06;
// Torsos without a waist, read all round, fit upside down 5 % better to 5 % worse: neither is told
// then. Where half of the skin or more was not read they fit up to 14 % better.
// On another build, whose belly or back fits worst, the wrong side fits up to 13 % better.
constexpr double kOppositeScore = 1.06, kOppositeScoreOfPart = 1.2, kWholeCoverage = 0.65;
// Before the warp as well as after it: read all round, right heads fit at least 1 % better in the
// product of both scores, turned ones 2 to 39 % worse. Of sweeps of the front right ones fit 19 %
// better to 24 % worse, and turned ones 14 % better to 19 % worse: nothing tells them apart.
constexpr double kOppositeBothWays = 1.03;
constexpr double kFrontScore = 1.2;
// Typical gaps of turned heads are 0.86 to 2.55 times those of right ones (40 of other builds read
// all round), of the front 1.06 to 1.97 times (40).
constexpr double kFreeConstraintMm = 3, kTypicalGap = 1.25, kSameTypicalGap = 1.05;
// A pose's score moves by some 4 % with the start that found it, so that scores nearer to each
// other are equal. Then the pose whose skin lay closer before it was deformed is the better one.
constexpr double kEqualScore = 1.04;
// Poses that reach fewer readings are not told apart by how close the rest of them lie.
constexpr double kJudgedCoverage = 0.5;
// Where less of the skin than this was swept, the open side may as well be a flank's. In
// windows of a front, poses that follow it fit at most 5 % worse than poses that are rolled away
// from it, in strips of a flank 24 % worse or more.
constexpr double kLittleSkin = 0.45, kFlankScore = 1.15;
constexpr int kFewerStarts = 3;   // the head the other way is looked for with a third of the starts
constexpr int kMoreSearches = 2;  // with twice the starts each, while only one start found the best

// What was given beside the surfaces.
struct Given {
    PoseHints hints;
    std::vector<Correspondence> landmarks;
};

// The coarse field of a candidate.
ResidualOptions judging_field() {
    ResidualOptions field;
    field.spacing_mm = 45;
    field.rounds = 3;
    field.tolerance = 1e-2;
    field.skin_queries = 900;
    return field;
}

// Evenly thinned, at most 900.
std::vector<std::uint32_t> judged_readings(const TargetSurface& target) {
    std::vector<std::uint32_t> readings = thin_target(target, 1.2 * target.spacing_mm);
    if (readings.size() <= 900) return readings;
    std::vector<std::uint32_t> fewer;
    for (std::size_t n = 0; n < 900; ++n) fewer.push_back(readings[n * readings.size() / 900]);
    return fewer;
}

RefineOptions judging_quadratic(const Given& given) {
    RefineOptions options;
    options.skin_queries = 900;
    options.iterations = 5;
    options.landmarks = given.landmarks;
    options.landmark_weight = given.hints.landmark_weight;
    return options;
}

double penalty(double gap) {
    return kJudgeScaleMm * kJudgeScaleMm * std::log1p(gap * gap / (kJudgeScaleMm * kJudgeScaleMm));
}

// A candidate after a stiff quadratic and a coarse field; its score sums the costs of gaps, missing
// counterparts, deformation and hints.
JudgedPose judge(const FitContext& s,
                 const TargetSurface& target,
                 const Given& given,
                 const SplinePenalty& field,
                 const RigidCandidate& rigid) {
    JudgedPose judged;
    judged.rigid = rigid;
    judged.quadratic = RigidQuadratic::from_rigid(rigid.target_from_skin);
    const std::vector<std::uint32_t> readings = judged_readings(target);
    RefineOptions options = judging_quadratic(given);
    double deformation = 0;
    for (double constraint : {3 * kJudgeConstraintMm, kJudgeConstraintMm}) {
        options.constraint_mm = constraint;
        const RefineResult refined =
            refine_quadratic(s.coarse, target, readings, judged.quadratic, options);
        judged.quadratic = refined.map;
        deformation = refined.constraint_cost;
        options.first_loss_mm = 5;
    }
    // The remaining cost of deforming the skin onto the mannequin: a coarse residual field.
    Registration map;
    map.quadratic = in_frames(judged.quadratic, s.coarse.origin, target.origin);
    map.ct_box = s.skin.box;
    const FieldFit fit = fit_field(s.coarse, target, readings, judging_field(), field, &map);
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
    judged.back_cost_mm2 = given.hints.back_cost_mm2(rigid.target_from_skin);
    double hints = judged.back_cost_mm2;
    for (const Correspondence& c : given.landmarks) {
        const Vector3 r = map_point(judged.quadratic, c.skin) - c.place;
        hints += given.hints.landmark_weight * std::min(dot(r, r), 60.0 * 60.0);
    }
    if (given.hints.up) {
        const Vector3 r = rigid.target_from_skin.rotation.column(2) - *given.hints.up;
        hints += given.hints.up_weight_mm2 * dot(r, r);
    }
    judged.score_mm = std::sqrt(gaps + 0.5 * deformation + fit.energy_mm2 + hints);
    judged.skin_coverage = static_cast<double>(matches.from_skin.size()) /
                           static_cast<double>(std::max<std::size_t>(1, matches.skin_queries));
    judged.coverage = static_cast<double>(matches.from_target.size()) /
                      static_cast<double>(std::max<std::size_t>(1, matches.target_queries));
    return judged;
}

std::vector<JudgedPose> judge_candidates(const FitContext& s,
                                         const TargetSurface& target,
                                         const Given& given,
                                         const SplinePenalty& field,
                                         RigidOptions rigid,
                                         const Progress& progress) {
    rigid.hints = given.hints;
    const std::vector<RigidCandidate> candidates =
        align_rigid_candidates(s.coarse, target, rigid, progress);
    report_progress(progress, 0.2, "rigid alignment: judging candidates");
    std::vector<JudgedPose> judged(candidates.size());
    parallel_for(candidates.size(), 1, [&](std::size_t begin, std::size_t end) {
        for (std::size_t n = begin; n < end; ++n)
            judged[n] = judge(s, target, given, field, candidates[n]);
    });
    return judged;
}

// The score without the cost of the open side: of the skins and the other hints alone.
double bare_mm(const JudgedPose& p) {
    return std::sqrt(std::max(0.0, p.score_mm * p.score_mm - p.back_cost_mm2));
}

// A sweep of one flank is open towards the other. Taken for the back, that would roll the patient
// by a quarter turn, which, unlike a half turn, fits clearly worse: then the open side says
// nothing.
bool drop_open_side(const FitContext& s,
                    const RegisterOptions& options,
                    std::vector<JudgedPose>& judged) {
    if (!s.hints.back || options.open_side != "auto" || s.target.table.found) return false;
    const JudgedPose *with = &judged[0], *without = &judged[0];
    for (const JudgedPose& p : judged) {
        if (p.score_mm < with->score_mm) with = &p;
        if (bare_mm(p) < bare_mm(*without)) without = &p;
    }
    const auto front = [](const JudgedPose& p) {
        return p.rigid.target_from_skin.rotation.column(1);
    };
    const bool followed = std::abs(dot(front(*with), *s.hints.back)) > kQuarterTurnCosine;
    const bool turned = std::abs(dot(front(*with), front(*without))) < kQuarterTurnCosine;
    if (followed && (!turned || bare_mm(*with) < kQuarterTurn * bare_mm(*without))) return false;
    for (JudgedPose& p : judged) {
        const double rigid = p.rigid.score_mm;
        p.rigid.score_mm = std::sqrt(std::max(0.0, rigid * rigid - p.back_cost_mm2));
        p.score_mm = bare_mm(p);
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

// The target mirrored in the patient's median plane, and what was given of it.
struct Mirror {
    Vector3 across, middle;

    Vector3 turned(Vector3 v) const { return v - 2 * dot(v, across) * across; }
    Point3 moved(Point3 p) const { return Point3{} + middle + turned((p - Point3{}) - middle); }
};

TargetSurface mirrored(const TargetSurface& target, const Mirror& mirror) {
    TargetSurface m;
    m.origin = target.origin;
    for (Point3 p : target.points) m.points.push_back(mirror.moved(p));
    for (Vector3 n : target.normals) m.normals.push_back(mirror.turned(n));
    m.on_rim = target.on_rim;
    m.lifted = target.lifted;
    m.spacing_mm = target.spacing_mm;
    m.index = PointIndex(m.points);
    return m;
}

Rigid mirrored(const Rigid& from, const Mirror& mirror) {
    return {Matrix3::from_columns(-mirror.turned(from.rotation.column(0)),
                                  mirror.turned(from.rotation.column(1)),
                                  mirror.turned(from.rotation.column(2))),
            mirror.moved(Point3{} + from.translation) - Point3{}};
}

Given mirrored(Given given, const Mirror& mirror) {
    for (PoseHints::Place& mark : given.hints.landmarks) mark.target = mirror.moved(mark.target);
    for (Correspondence& mark : given.landmarks) mark.place = mirror.moved(mark.place);
    if (given.hints.up) given.hints.up = mirror.turned(*given.hints.up);
    if (given.hints.back) given.hints.back = mirror.turned(*given.hints.back);
    return given;
}

// Cosines between two poses' directions to the head, and to the front.
double heads(const JudgedPose& a, const JudgedPose& b) {
    return dot(a.rigid.target_from_skin.rotation.column(2),
               b.rigid.target_from_skin.rotation.column(2));
}
double fronts(const JudgedPose& a, const JudgedPose& b) {
    return dot(a.rigid.target_from_skin.rotation.column(1),
               b.rigid.target_from_skin.rotation.column(1));
}

bool turned_front_to_back(const JudgedPose& a, const JudgedPose& b) {
    return heads(a, b) > 0.7 && fronts(a, b) < -0.5;
}

// Best first; those that have slid off the readings last. Of a pose and one with its head where the
// other has its feet that are as good as equal, the one that fits best without a warp; of poses
// turned front to back that tells nothing.
void rank(std::vector<JudgedPose>& judged) {
    double best_coverage = 0;
    for (const JudgedPose& p : judged) best_coverage = std::max(best_coverage, p.coverage);
    std::stable_sort(judged.begin(), judged.end(),
                     [best_coverage](const JudgedPose& a, const JudgedPose& b) {
                         const bool a_off = slid_off(a.coverage, best_coverage),
                                    b_off = slid_off(b.coverage, best_coverage);
                         return a_off == b_off ? a.score_mm < b.score_mm : b_off;
                     });
    std::size_t best = 0;
    for (std::size_t n = 1; n < judged.size(); ++n) {
        if (std::min(judged[0].coverage, judged[n].coverage) < kJudgedCoverage) break;
        if (judged[n].score_mm > kEqualScore * judged[0].score_mm) break;
        if (heads(judged[0], judged[n]) > -0.5) continue;
        if (judged[n].rigid.score_mm < judged[best].rigid.score_mm) best = n;
    }
    const auto at = judged.begin() + static_cast<std::ptrdiff_t>(best);
    std::rotate(judged.begin(), at, at + 1);
}

// Candidates of a smaller search that does not know of the open side, best first.
std::vector<JudgedPose> judge_without_open_side(const FitContext& s,
                                                Given given,
                                                const SplinePenalty& field,
                                                RigidOptions rigid,
                                                const Progress& progress) {
    given.hints.back.reset();
    rigid.starts = std::max(1, rigid.starts / kFewerStarts);
    rigid.candidates = std::max(1, rigid.candidates / 2);
    std::vector<JudgedPose> judged = judge_candidates(s, s.target, given, field, rigid, progress);
    rank(judged);
    return judged;
}

// Whether a strip of skin lies clearly better when it is rolled away from the side that it is open
// to. That side pulls all candidates, so that they alone do not tell.
bool is_strip_of_flank(const FitContext& s,
                       const RegisterOptions& options,
                       const Given& given,
                       const SplinePenalty& field,
                       const JudgedPose& best,
                       const Progress& progress) {
    if (!given.hints.back || options.open_side != "auto" || s.target.table.found ||
        best.skin_coverage >= kLittleSkin)
        return false;
    const JudgedPose other =
        judge_without_open_side(s, given, field, options.rigid, progress).front();
    const Vector3 front = other.rigid.target_from_skin.rotation.column(1);
    return std::abs(dot(front, *given.hints.back)) < kQuarterTurnCosine &&
           best.score_mm > kFlankScore * other.score_mm;
}

// What the scores of a pose and of its opposite tell.
enum class Verdict { right, wrong, untold };
Verdict verdict_of(double here_mm, double opposite_mm, double margin) {
    if (opposite_mm * margin < here_mm) return Verdict::wrong;
    return opposite_mm > margin * here_mm ? Verdict::right : Verdict::untold;
}
double margin_of(const JudgedPose& best, double of_whole) {
    return best.skin_coverage < kWholeCoverage ? kOppositeScoreOfPart : of_whole;
}

// How well the skins fit in the best of the poses that have not slid off.
double best_fit_mm(const std::vector<JudgedPose>& judged) {
    double best_coverage = 0, best = INFINITY;
    for (const JudgedPose& p : judged) best_coverage = std::max(best_coverage, p.coverage);
    for (const JudgedPose& p : judged)
        if (!slid_off(p.coverage, best_coverage)) best = std::min(best, bare_mm(p));
    return best;
}

// Left-handed axes: the surface is then a mirror image of the body, which a landmark off the
// midline shows, or the skin where its right and left differ. Most torsos' hardly do. The open side
// has no part in it: where it is a flank's, it costs either hand a chance amount.
void check_hands(const FitContext& s,
                 const Given& given,
                 const SplinePenalty& field,
                 const RigidOptions& options,
                 const std::vector<JudgedPose>& judged,
                 const Progress& progress,
                 PoseChoice* choice) {
    const Rigid& pose = choice->best.rigid.target_from_skin;
    const Mirror mirror{pose.rotation.column(0), pose.translation};
    const TargetSurface target = mirrored(s.target, mirror);
    const Given there = mirrored(given, mirror);
    RigidOptions rigid = options;
    rigid.hints = there.hints;
    const double here = best_fit_mm(judged);
    // From the pose itself, and where that does not fit from the mirror images of the others: the
    // right pose of a left-handed surface is seldom the one that it seems to have. Before the axes
    // are called right, a search of the mirror image's own.
    std::vector<JudgedPose> in_mirror;
    for (const JudgedPose& other : judged) {
        const Rigid start = mirrored(other.rigid.target_from_skin, mirror);
        in_mirror.push_back(
            judge(s, target, there, field, refine_rigid(s.coarse, target, start, rigid)));
        if (best_fit_mm(in_mirror) < kMirrorScore * here) break;
    }
    if (best_fit_mm(in_mirror) >= kMirrorScore * here) {
        for (const JudgedPose& p : judge_candidates(s, target, there, field, rigid, progress))
            in_mirror.push_back(p);
    }
    const double score = choice->mirror_score_mm = best_fit_mm(in_mirror);
    const std::string scores =
        text("it fits to %.2f mm in a mirror and to %.2f mm as given", score, here);
    if (score * kMirrorScore < here) {
        choice->handedness = "wrong: " + scores;
        choice->warnings.push_back("the surface looks like a mirror image of the patient: " +
                                   scores + "; check that its axes are right-handed");
    } else if (score < margin_of(choice->best, kMirrorScore) * here) {
        choice->handedness = "not told by the skin: " + scores +
                             "; a landmark off the midline would tell (--landmarks FILE.csv)";
    } else {
        choice->handedness = "right: " + scores;
    }
}

// How near half of the readings lie to the skin, after a stiff and after a freer quadratic: the
// geometric mean of both medians. Another build differs in a part of the skin, which costs in a
// mean what the whole of the skin tells; a median leaves that part out.
double typical_gap_mm(const FitContext& s, const Given& given, const Rigid& pose) {
    const std::vector<std::uint32_t> readings = judged_readings(s.target);
    RefineOptions options = judging_quadratic(given);
    RigidQuadratic map = RigidQuadratic::from_rigid(pose);
    double product = 1;
    for (const double constraint :
         {3 * kJudgeConstraintMm, kJudgeConstraintMm, kFreeConstraintMm}) {
        options.constraint_mm = constraint;
        map = refine_quadratic(s.coarse, s.target, readings, map, options).map;
        options.first_loss_mm = 5;
        if (constraint == kJudgeConstraintMm) continue;
        MatchOptions gates;
        gates.farthest_mm = options.last_gate_mm;
        gates.side_step_mm = 1.2 * s.target.spacing_mm;
        const MappedSkin mapped = map_skin(s.coarse, map);
        std::vector<double> gaps;
        for (const Match& m : find_matches(s.coarse, mapped.points, mapped.normals, mapped.index,
                                           s.target, readings, 0, gates)
                                  .from_target)
            gaps.push_back(std::abs(m.gap_mm));
        if (static_cast<double>(gaps.size()) <
            kJudgedCoverage * static_cast<double>(readings.size()))
            return INFINITY;
        const auto middle = gaps.begin() + static_cast<std::ptrdiff_t>(gaps.size() / 2);
        std::nth_element(gaps.begin(), middle, gaps.end());
        product *= std::max(*middle, 0.1);
    }
    return std::sqrt(product);
}

// The head the other way than was said.
// side_is_assumed  nobody said which side of the patient the sweep is open to
void check_head(const FitContext& s,
                const Given& given,
                const SplinePenalty& field,
                const RigidOptions& options,
                bool side_is_assumed,
                const Progress& progress,
                PoseChoice* choice) {
    if (!given.hints.up) {
        // Less than half of the skin, mostly its front, has no head and feet of its own.
        if (choice->best.skin_coverage < kWholeCoverage && given.landmarks.size() < 2)
            choice->head =
                "not told: no head direction was given, and so little of the skin was read that "
                "it may as well lie the other way; --up X,Y,Z or two landmarks such as crotch and "
                "navel would tell (--landmarks FILE.csv)";
        return;
    }
    Given turned = given;
    turned.hints.up = -*given.hints.up;
    RigidOptions rigid = options;
    rigid.starts = std::max(1, rigid.starts / kFewerStarts);
    double score = INFINITY, rigid_score = INFINITY;
    Rigid opposite;
    for (const JudgedPose& p : judge_candidates(s, s.target, turned, field, rigid, progress)) {
        if (p.score_mm >= score) continue;
        score = p.score_mm;
        rigid_score = p.rigid.score_mm;
        opposite = p.rigid.target_from_skin;
    }
    const double best = choice->best.score_mm, rigid_best = choice->best.rigid.score_mm;
    Verdict verdict = verdict_of(best, score, margin_of(choice->best, kOppositeScore));
    // Not while the opposite follows the open side, which may be a flank's, or the front of a
    // patient whose back was swept.
    const bool may_mislead = verdict == Verdict::right && given.hints.back &&
                             choice->best.skin_coverage < kWholeCoverage;
    if (may_mislead) {
        const JudgedPose other =
            judge_without_open_side(s, turned, field, options, progress).front();
        if (other.score_mm < score) {
            score = other.score_mm;
            rigid_score = other.rigid.score_mm;
        }
        if (verdict_of(best, score, kOppositeScoreOfPart) != Verdict::right)
            verdict = Verdict::untold;
    }
    choice->turned_score_mm = score;
    if (verdict == Verdict::untold && choice->best.skin_coverage >= kWholeCoverage &&
        best * rigid_best > kOppositeBothWays * score * rigid_score)
        verdict = Verdict::wrong;
    std::string scores = text(
        "fits to %.2f mm the other way and to %.2f mm as given (%.2f and %.2f mm before the "
        "warp)",
        score, best, rigid_score, rigid_best);
    // What the scores tell holds if the typical gaps say the same; where they tell nothing, typical
    // gaps that differ clearly do. Of a pose that has slid off nothing is known.
    const double typical = typical_gap_mm(s, given, choice->best.rigid.target_from_skin),
                 turned_typical = typical_gap_mm(s, turned, opposite);
    const bool reached = std::isfinite(typical) && std::isfinite(turned_typical);
    if (choice->best.skin_coverage < kLittleSkin) {
        if (!reached) verdict = Verdict::untold;
    } else if (reached) {
        if (verdict == Verdict::untold && !may_mislead) {
            const Verdict clear = verdict_of(typical, turned_typical, kTypicalGap);
            const Verdict by_score = verdict_of(best, score, kEqualScore);
            if (by_score == Verdict::untold || by_score == clear) verdict = clear;
            scores += text(", half of the readings to %.2f and %.2f mm", turned_typical, typical);
        } else if (verdict != verdict_of(typical, turned_typical, kSameTypicalGap)) {
            verdict = Verdict::untold;
        }
    }
    if (verdict == Verdict::wrong) {
        // Where the head as given fits as well without the open side, one of the two is wrong.
        const bool either =
            given.hints.back && side_is_assumed && choice->best.skin_coverage < kWholeCoverage &&
            verdict_of(judge_without_open_side(s, given, field, options, progress).front().score_mm,
                       score, kOppositeScoreOfPart) != Verdict::wrong;
        choice->head = "wrong: it " + scores;
        choice->warnings.push_back(
            "the head direction seems to point to the feet" +
            std::string(either ? ", or the sweep to be of the patient's back" : "") +
            ": the skin " + scores + "; turn its sign (--up), " +
            (either ? "say --open-side front for a patient who lies prone, " : "") +
            "or give two landmarks such as crotch and navel if it is right (--landmarks FILE.csv)");
    } else if (verdict == Verdict::untold && given.landmarks.size() < 2) {
        choice->head = "not told by the skin: it " + scores +
                       "; two landmarks such as crotch and navel would tell (--landmarks FILE.csv)";
    } else {
        choice->head = "right: it " + scores;
    }
}

// The patient the other way round, front to back, about the middle of the readings. What the open
// side costs either way is left out: it is what is to be told.
void check_front(const FitContext& s,
                 const Given& given,
                 const SplinePenalty& field,
                 const RigidOptions& options,
                 const std::vector<JudgedPose>& judged,
                 PoseChoice* choice) {
    const JudgedPose& best = choice->best;
    Given turned = given;
    if (given.hints.back) turned.hints.back = -*given.hints.back;
    RigidOptions rigid = options;
    rigid.hints = turned.hints;
    Vector3 middle;
    for (Point3 p : s.target.points)
        middle = middle + (p - Point3{}) / static_cast<double>(s.target.points.size());
    const Matrix3& turn = best.rigid.target_from_skin.rotation;
    const Matrix3 half = Matrix3::from_columns(-turn.column(0), -turn.column(1), turn.column(2));
    // x -> middle + half (turn^T (x - middle)) after the pose.
    const Vector3 at = best.rigid.target_from_skin.translation, from = at - middle;
    const auto score_from = [&](const Rigid& start) {
        return bare_mm(
            judge(s, s.target, turned, field, refine_rigid(s.coarse, s.target, start, rigid)));
    };
    double score = score_from({half, middle + half * (transpose(turn) * from)});
    // The middle of a strip lies in the skin: there the body turns where it lies.
    if (best.skin_coverage < kLittleSkin) score = std::min(score, score_from({half, at}));
    for (const JudgedPose& p : judged)  // the search may have come to a better one
        if (turned_front_to_back(best, p)) score = std::min(score, bare_mm(p));
    choice->front_turned_score_mm = score;
    const double here = bare_mm(best);
    const std::string scores =
        text("it fits to %.2f mm turned front to back and to %.2f mm as it lies", score, here);
    Verdict verdict = verdict_of(here, score, margin_of(best, kOppositeScore));
    if (verdict == Verdict::right && score < kFrontScore * here) verdict = Verdict::untold;
    if (given.hints.back && verdict == Verdict::wrong) {
        choice->front = "wrong: " + scores;
        choice->warnings.push_back(
            "the patient seems to lie the other way round, front to back: " + scores +
            "; check the open side (--open-side), or give a landmark on the front and one on the "
            "back (--landmarks FILE.csv)");
    } else if (verdict != Verdict::right && given.landmarks.size() < 2) {
        choice->front = std::string(given.hints.back ? "told by the open side, not by the skin: "
                                                     : "not told by the skin: ") +
                        scores +
                        "; a landmark on the front and one on the back would tell (--landmarks "
                        "FILE.csv)";
    } else {
        choice->front = "right: " + scores;
    }
}

// "a", "a and b", "a, b and c".
std::string listed(const std::vector<std::string>& items) {
    std::string all;
    for (std::size_t n = 0; n < items.size(); ++n)
        all += (n == 0 ? "" : n + 1 < items.size() ? ", " : " and ") + items[n];
    return all;
}

// One sentence for all that the skin leaves open, and what settles it: nothing else shows a fit
// that is wrong there.
void warn_of_untold(const FitContext& s, PoseChoice* choice) {
    const auto untold = [](const std::string& note) {
        return note.starts_with("not told") || note.starts_with("told by the open side");
    };
    std::vector<std::string> open, unseen, marks;
    if (untold(choice->head)) {
        open.push_back("head from feet");
        unseen.push_back(s.hints.up ? "a head direction with its sign turned (--up)"
                                    : "a patient upside down");
        marks.push_back(s.hints.up ? "crotch and navel" : "crotch and navel (or --up X,Y,Z)");
    }
    if (untold(choice->handedness)) {
        open.push_back("right from left");
        unseen.push_back("a surface with left-handed axes");
        marks.push_back("a hip");
    }
    if (untold(choice->front)) {
        open.push_back("front from back");
        unseen.push_back("a patient turned front to back");
        marks.push_back("a place on the back");
    }
    if (open.empty()) return;
    choice->warnings.insert(
        choice->warnings.begin(),
        "not verified: the skin does not tell " + listed(open) + ", so that " + listed(unseen) +
            " would fit as well; landmarks settle it (--landmarks FILE.csv): " + listed(marks));
}

}  // namespace

PoseChoice choose_pose(const FitContext& s,
                       const RegisterOptions& options,
                       const Progress& progress) {
    RigidOptions rigid = options.rigid;
    const SplinePenalty field = field_penalty(s.coarse, s.skin.box, judging_field());
    Given given{s.hints, s.landmarks};
    report_progress(progress, 0.05, "rigid alignment: starts");
    PoseChoice choice;
    std::vector<JudgedPose> judged;
    for (int search = 0;; ++search) {
        judged = judge_candidates(s, s.target, given, field, rigid, progress);
        choice.open_side_dropped = drop_open_side(s, options, judged);
        rank(judged);
        // A pose that one start alone has found may have a better one beside it that none has.
        if (judged[0].rigid.found > 1 || search == kMoreSearches) break;
        rigid.starts *= 2;
    }
    if (!choice.open_side_dropped &&
        is_strip_of_flank(s, options, given, field, judged[0], progress)) {
        choice.open_side_dropped = true;
        given.hints.back.reset();
        judged = judge_candidates(s, s.target, given, field, rigid, progress);
        rank(judged);
    }
    choice.best = judged[0];
    for (std::size_t n = 1; n < judged.size(); ++n) {
        choice.runners_up.push_back(described(judged[0], judged[n]));
    }
    warn_of_runners_up(s, &choice);
    if (choice.open_side_dropped) given.hints.back.reset();
    rigid.starts = options.rigid.starts;
    check_head(s, given, field, rigid, options.open_side == "auto" && !s.target.table.found,
               progress, &choice);
    check_hands(s, given, field, rigid, judged, progress, &choice);
    check_front(s, given, field, rigid, judged, &choice);
    warn_of_untold(s, &choice);
    return choice;
}

}  // namespace sonocase::pipeline::inline registration
