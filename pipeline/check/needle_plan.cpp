// SPDX-License-Identifier: Apache-2.0

#include "pipeline/check/needle_plan.h"

#include <algorithm>
#include <cmath>

#include "formats/scoring/sight.h"

namespace sonocase::pipeline::inline check {
namespace {

constexpr double kSpareMm = 5;       // length of the needle that stays outside, for the hand
constexpr double kGoodEnough = 0.9;  // the search ends when this share of a path is seen
constexpr double kRoomMm = 2;        // about a hand's tremor and a voxel
constexpr double kRoomWorth = 0.2;   // of visibility: what a path with room may show less
constexpr double kSkinWithinMm = 3;  // of where the body begins: a voxel and its boundary
constexpr double kAboveMm = 40;      // where the search for the skin beside the probe begins
constexpr double kSteepest = 0.985;  // cosine of 10 degrees: a steeper needle meets the probe

// What decides about visibility.
Exercise exercise_of(const AimOptions& options) {
    Exercise exercise;
    exercise.probe = options.probe;
    exercise.needle = options.needle;
    return exercise;
}

bool good_enough(const NeedlePlan& plan) {
    return plan.roomy && plan.visible > kGoodEnough;
}

}  // namespace

Rigid probe_pose(Point3 skin, Vector3 beam, Vector3 lateral) {
    const Vector3 elevation = normalized(cross(beam, lateral));
    return {Matrix3::from_columns(cross(elevation, beam), elevation, beam), skin - Point3{}};
}

NeedlePlanner::NeedlePlanner(const CaseLabels& labels, const AimOptions& options)
    : options_(options),
      anatomy_(labels.bundle(), options.breathing),
      sight_(&anatomy_, exercise_of(options)) {
    const std::vector<Label>& palette = labels.bundle().labels;
    has_skin_ = labels.has_skin();
    for (std::size_t l = 0; l < palette.size(); ++l) {
        skin_[l] = labels.is_skin(static_cast<int>(l));
        closed_[l] = labels.is_vessel(static_cast<int>(l)) ||
                     std::find(options.keep_clear.begin(), options.keep_clear.end(),
                               palette[l].name) != options.keep_clear.end();
    }
}

// Where the scan cuts the body, it ends without skin.
bool NeedlePlanner::through_skin(Point3 entry, Vector3 along) const {
    if (!has_skin_) return true;
    for (double t = 0; t <= kSkinWithinMm; t += 0.5)
        if (skin_[static_cast<std::size_t>(anatomy_.label(entry + t * along))]) return true;
    return false;
}

std::optional<Point3> NeedlePlanner::enter(Point3 above, Vector3 along, double reach_mm) const {
    if (anatomy_.inside(above)) return std::nullopt;
    for (double t = 0; t < reach_mm; t += 1) {
        if (!anatomy_.inside(above + t * along)) continue;
        double low = t - 1, high = t;
        for (int n = 0; n < 6; ++n) {
            const double middle = 0.5 * (low + high);
            (anatomy_.inside(above + middle * along) ? high : low) = middle;
        }
        const Point3 skin = above + high * along;
        if (anatomy_.at_edge(skin) || !through_skin(skin, along)) return std::nullopt;
        return skin;
    }
    return std::nullopt;
}

bool NeedlePlanner::free(Point3 entry, Vector3 along, double length_mm, int own) const {
    const int phases = options_.breathing.amplitude_mm != 0 ? 3 : 1;
    for (int n = 0; n < phases; ++n) {
        const double time_s = 0.25 * n * options_.breathing.period_s;
        for (double s = 0.5; s < length_mm; s += 1) {
            const int label = anatomy_.label(anatomy_.at_rest(entry + s * along, time_s));
            if (label == own) continue;
            if (anatomy_.blocks_sound(label) || closed_[label]) return false;
        }
    }
    return true;
}

bool NeedlePlanner::roomy(const NeedlePlan& plan, double length_mm, int own) const {
    const Vector3 side = normalized(cross(plan.beam, plan.lateral));
    const Vector3 other = cross(plan.direction, side);  // the path lies in the picture's plane
    for (const Vector3 off : {side, -side, other, -other})
        if (!free(plan.entry + kRoomMm * off, plan.direction, length_mm, own)) return false;
    return true;
}

void NeedlePlanner::try_pose(const AimTarget& target,
                             NeedlePlan pose,
                             std::optional<NeedlePlan>& best) const {
    const Probe& probe = options_.probe;
    const Rigid mannequin_from_probe = probe_pose(pose.skin, pose.beam, pose.lateral);
    const Rigid probe_from_mannequin = inverse(mannequin_from_probe);
    const Point3 centre = probe_from_mannequin * target.centre;
    if (!in_image(probe, centre.x, centre.z) ||
        !sound_reaches(anatomy_, probe, mannequin_from_probe, centre, 0))
        return;
    const int own = anatomy_.label(target.centre);
    for (double beside = 6; beside < 58; beside += 6) {
        const double off = half_face_mm(probe) + beside;
        const auto entry =
            enter(pose.skin + off * pose.lateral - kAboveMm * pose.beam, pose.beam, 120);
        if (!entry) continue;
        const double length = distance(*entry, target.centre);
        if (length > options_.needle.length_mm - kSpareMm || length < 5) continue;
        pose.entry = *entry;
        pose.direction = (1 / length) * (target.centre - *entry);
        if (dot(pose.direction, pose.beam) > kSteepest) continue;
        if (!free(*entry, pose.direction, length, own)) continue;
        pose.visible =
            sight_.visible_mm(mannequin_from_probe, centre, probe_from_mannequin * *entry, 0) /
            length;
        pose.roomy = roomy(pose, length, own);
        const auto worth = [](const NeedlePlan& p) { return p.visible + p.roomy * kRoomWorth; };
        if (!best || worth(pose) > worth(*best) + 0.02) best = pose;
        if (good_enough(*best)) return;
    }
}

std::optional<NeedlePlan> NeedlePlanner::plan(const AimTarget& target,
                                              Point3 skin,
                                              Vector3 beam,
                                              std::span<const Vector3> laterals) const {
    // The window's point lies inside the last voxel of the body; the surface is farther out.
    const auto surface = enter(skin - 10 * beam, beam, 30);
    if (surface) skin = *surface;
    std::optional<NeedlePlan> best;
    for (const double rocked : {0.0, -0.17, 0.17, -0.35, 0.35})
        for (const Vector3 lateral : laterals) {
            NeedlePlan pose;
            pose.skin = skin;
            pose.beam = std::cos(rocked) * beam + std::sin(rocked) * lateral;
            pose.lateral = std::cos(rocked) * lateral - std::sin(rocked) * beam;
            try_pose(target, pose, best);
            if (best && good_enough(*best)) return best;
        }
    return best;
}

}  // namespace sonocase::pipeline::inline check
