// SPDX-License-Identifier: Apache-2.0

#include <algorithm>
#include <cmath>

#include "formats/base/arc_tangent.h"
#include "formats/scoring/score_parts.h"
#include "formats/scoring/session_monitor.h"

namespace sonocase::detail {

void score_guidance(const ScoreInput& input, MetricValues& values) {
    if (!input.anatomy || input.probe.points.empty()) return;
    double in_beam = 0, inserted = 0, seconds = 0, view_s = 0, plane = 0, plane_max = 0, angle = 0;
    double advance = 0, advance_in_view = 0;
    for (std::size_t i = 1; i < input.readings.size(); ++i) {
        const NeedleReading& r = input.readings[i];
        if (!r.inside || !r.seen) continue;
        const double dt = input.step_s(i);
        in_beam += dt * r.in_beam_mm;
        inserted += dt * r.depth_mm;
        seconds += dt;
        if (r.tip_in_view) view_s += dt;
        plane += dt * std::abs(r.plane_mm);
        plane_max = std::max(plane_max, std::abs(r.plane_mm));
        const Vector3 normal = input.session.samples[input.needle.points[i].sample]
                                   .mannequin_from_probe.rotation.column(1);
        const double sine = std::min(std::abs(dot(normal, input.direction(i))), 1.0);
        angle += dt * kDegrees * arc_tangent(sine, std::sqrt((1 - sine) * (1 + sine)));
        const double forward =
            std::max(dot(input.tip(i) - input.tip(i - 1), input.direction(i)), 0.0);
        advance += forward;
        if (r.tip_in_view) advance_in_view += forward;
    }
    if (!(seconds > 0)) return;
    if (inserted > 0) values["needle_in_beam_fraction"] = in_beam / inserted;
    values["needle_in_beam_mm"] = in_beam / seconds;
    values["tip_in_view_fraction"] = view_s / seconds;
    if (advance > 0) values["tip_in_view_at_advance_fraction"] = advance_in_view / advance;
    values["needle_plane_distance_mean_mm"] = plane / seconds;
    values["needle_plane_distance_max_mm"] = plane_max;
    values["needle_plane_angle_mean_deg"] = angle / seconds;
}

void score_probe_use(const ScoreInput& input, MetricValues& values) {
    const std::vector<TrackPoint>& points = input.probe.points;
    if (!input.anatomy || points.empty()) return;
    double usage_s = 0;
    for (std::size_t i = 1; i < points.size(); ++i) {
        if (probe_on_skin(*input.anatomy, input.exercise.probe, points[i].pose))
            usage_s += points[i].time_s - points[i - 1].time_s;
    }
    values["probe_usage_time_s"] = usage_s;
}

}  // namespace sonocase::detail
