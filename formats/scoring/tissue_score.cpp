// SPDX-License-Identifier: Apache-2.0

#include <algorithm>
#include <cmath>

#include "formats/scoring/score_parts.h"

namespace sonocase::detail {
namespace {

// Separate periods in which touches(reading) holds; breaks up to contact_pause_s do not separate
// two of them.
template <class Touches>
int contacts(const ScoreInput& input, Touches touches) {
    int count = 0;
    double last_s = -INFINITY;
    for (std::size_t i = 0; i < input.readings.size(); ++i) {
        if (!touches(input.readings[i])) continue;
        const bool touched_before = i > 0 && touches(input.readings[i - 1]);
        if (!touched_before && input.time(i) - last_s > input.options.contact_pause_s) ++count;
        last_s = input.time(i);
    }
    return count;
}

}  // namespace

void score_motion(const std::string& tool,
                  const ToolTrack& track,
                  const MotionOptions& options,
                  MetricValues& values) {
    if (track.points.empty()) return;
    const MotionMetrics m = motion_metrics(track.points, options);
    values[tool + "elapsed_time_s"] = m.elapsed_time_s;
    values[tool + "path_length_mm"] = m.path_length_mm;
    values[tool + "filtered_path_length_mm"] = m.filtered_path_length_mm;
    values[tool + "average_velocity_mm_s"] = m.average_velocity_mm_s;
    values[tool + "motion_smoothness_mm_s3"] = m.motion_smoothness_mm_s3;
    values[tool + "path_inefficiency_percent"] = m.path_inefficiency_percent;
    values[tool + "translational_actions"] = m.translational_actions;
    values[tool + "rotational_actions"] = m.rotational_actions;
    values[tool + "rotation_total_deg"] = m.rotation_total_deg;
    values[tool + "bounding_box_mm3"] = m.bounding_box_mm3;
}

void score_tissue(const ScoreInput& input,
                  bool has_no_go,
                  MetricValues& values,
                  std::vector<std::string>& warnings) {
    double axial = 0;
    for (std::size_t i = 1; i < input.readings.size(); ++i) {
        axial += std::abs(dot(input.tip(i) - input.tip(i - 1), input.direction(i)));
    }
    values["depth_perception_mm"] = axial;
    if (!input.anatomy) return;
    double path = 0, time_in = 0, damage = 0, no_go_s = 0, deepest = 0;
    int punctures = 0;
    bool punctured = false;
    const double length = input.exercise.needle.length_mm;
    for (std::size_t i = 0; i < input.readings.size(); ++i) {
        const NeedleReading& r = input.readings[i];
        deepest = std::max(deepest, r.depth_mm);
        if (!punctured && r.inside && r.ahead && r.behind) {
            ++punctures;
            punctured = true;
        } else if (punctured && !r.inside && !r.ahead && !r.behind) {
            punctured = false;
        }
        if (i == 0 || !r.inside) continue;
        path += distance(input.tip(i), input.tip(i - 1));
        time_in += input.step_s(i);
        if (r.no_go) no_go_s += input.step_s(i);
        const NeedleReading& before = input.readings[i - 1];
        if (!before.inside) continue;
        // The shaft swept the quadrilateral between its two inserted parts: two triangles.
        const Point3 end = input.tip(i) - std::min(r.depth_mm, length) * input.direction(i);
        const Point3 end_before =
            input.tip(i - 1) - std::min(before.depth_mm, length) * input.direction(i - 1);
        damage += 0.5 * norm(cross(input.tip(i) - input.tip(i - 1), end - input.tip(i - 1)));
        damage += 0.5 * norm(cross(end - input.tip(i - 1), end_before - input.tip(i - 1)));
    }
    values["path_in_tissue_mm"] = path;
    values["time_in_tissue_s"] = time_in;
    values["tissue_damage_mm2"] = damage;
    values["tissue_punctures"] = punctures;
    values["deepest_mm"] = deepest;
    values["skin_contacts"] = contacts(input, [](const NeedleReading& r) { return r.touches; });
    if (has_no_go || input.exercise.no_go.empty()) {
        values["no_go_contacts"] = contacts(input, [](const NeedleReading& r) { return r.no_go; });
        values["no_go_time_s"] = no_go_s;
    } else {
        warnings.push_back("The body has none of the structures to be spared.");
    }
}

}  // namespace sonocase::detail
