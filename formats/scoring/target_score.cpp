// SPDX-License-Identifier: Apache-2.0

#include <algorithm>
#include <cmath>

#include "formats/base/arc_tangent.h"
#include "formats/base/portable_math.h"
#include "formats/scoring/image_region.h"
#include "formats/scoring/score_parts.h"
#include "formats/scoring/target_tree.h"

namespace sonocase::detail {
namespace {

// How the last insertion ended, and how straight it was.
void score_last_insertion(const ScoreInput& input,
                          const std::vector<InsertionScore>& insertions,
                          MetricValues& values) {
    if (insertions.empty()) return;
    double error = 0;
    for (const InsertionScore& s : insertions) error += s.tip_to_target_mm;
    values["targeting_error_mm"] = error / static_cast<double>(insertions.size());
    const InsertionScore& last = insertions.back();
    values["final_tip_to_target_mm"] = last.tip_to_target_mm;
    const Vector3 line = last.target_centre - last.entry;
    if (!(norm(line) > 0)) return;
    const Vector3 u = normalized(line);
    // An arc tangent keeps full precision at small angles, where an arc cosine loses half of it.
    values["final_angle_deg"] =
        kDegrees * arc_tangent(norm(cross(last.final_direction, u)), dot(last.final_direction, u));
    double greatest = 0, sum = 0, weight = 0;
    for (std::size_t i = 0; i < input.readings.size(); ++i) {
        if (!input.readings[i].inside || input.time(i) < last.entry_s ||
            input.time(i) > last.exit_s)
            continue;
        const double off = norm(cross(input.tip(i) - last.entry, u));
        greatest = std::max(greatest, off);
        sum += input.step_s(i) * off;
        weight += input.step_s(i);
    }
    values["trajectory_deviation_mm"] = greatest;
    if (weight > 0) values["trajectory_deviation_mean_mm"] = sum / weight;
}

}  // namespace

void score_targets_hit(const ScoreInput& input,
                       const std::vector<InsertionScore>& insertions,
                       MetricValues& values,
                       std::vector<TargetScore>& scores) {
    const std::vector<Target>& targets = input.exercise.targets;
    if (targets.empty()) return;
    TargetTree hits(targets);
    const double shift = input.target_shift_mm();
    int hit = 0;
    for (std::size_t i = 0; i < input.readings.size() && !hits.empty(); ++i) {
        const Point3 p = input.tip(i);
        hits.search([&](Point3 c, double radius) { return distance(c, p) <= radius + shift; },
                    [&](std::uint32_t t) {
                        const double d = distance(input.target_at(t, input.time(i)), p);
                        if (!(d <= targets[t].hit_radius_mm)) return false;
                        scores[t].first_hit_s = input.time(i);
                        ++hit;
                        return true;
                    });
    }
    values["targets_hit"] = hit;
    values["targets_hit_fraction"] = hit / static_cast<double>(targets.size());
    score_last_insertion(input, insertions, values);
}

void score_targets_scanned(const ScoreInput& input,
                           MetricValues& values,
                           std::vector<TargetScore>& scores) {
    if (input.probe.points.empty()) return;
    const Probe& probe = input.exercise.probe;
    const std::vector<Target>& targets = input.exercise.targets;
    if (targets.empty()) return;
    TargetTree centres(targets), parts(targets);
    const double reach = probe.depth_mm + std::max(probe.radius_mm, probe.width_mm);
    const double slack = input.options.target_slab_mm + input.target_shift_mm();
    int scanned = 0, seen = 0;
    for (const TrackPoint& point : input.probe.points) {
        if (centres.empty() && parts.empty()) break;
        const Rigid probe_from = inverse(point.pose);
        const auto near = [&](Point3 c, double radius) {
            const Point3 p = probe_from * c;
            return std::abs(p.y) <= radius + slack &&
                   hypotenuse(p.x, p.z) <= reach + radius + slack;
        };
        centres.search(near, [&](std::uint32_t t) {
            const Point3 p = probe_from * input.target_at(t, point.time_s);
            if (!(std::abs(p.y) < input.options.target_slab_mm) || !in_image(probe, p.x, p.z))
                return false;
            scores[t].first_scanned_s = point.time_s;
            ++scanned;
            return true;
        });
        parts.search(near, [&](std::uint32_t t) {
            const Point3 p = probe_from * input.target_at(t, point.time_s);
            const double radius = targets[t].radius_mm;
            if (!(std::abs(p.y) <= radius)) return false;
            const double in_plane = std::sqrt(radius * radius - p.y * p.y);
            if (!(distance_to_image(probe, p.x, p.z) <= in_plane)) return false;
            scores[t].first_seen_s = point.time_s;
            ++seen;
            return true;
        });
    }
    const double count = static_cast<double>(targets.size());
    values["targets_scanned_percent"] = 100 * scanned / count;
    values["structures_scanned_percent"] = 100 * seen / count;
}

}  // namespace sonocase::detail
