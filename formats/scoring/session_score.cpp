// SPDX-License-Identifier: Apache-2.0

#include "formats/scoring/session_score.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "formats/exercise/metric_table.h"
#include "formats/scoring/score_parts.h"

namespace sonocase {
namespace {

using detail::MetricValues;
using detail::ScoreInput;

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

void score_times(const ScoreInput& input,
                 MetricValues& values,
                 std::vector<std::string>& warnings) {
    double first = INFINITY, last = -INFINITY;
    for (const ToolTrack* track : {&input.probe, &input.needle}) {
        if (track->points.empty()) continue;
        first = std::min(first, track->points.front().time_s);
        last = std::max(last, track->points.back().time_s);
    }
    if (first <= last) values["elapsed_time_s"] = last - first;
    if (!input.needle.points.empty()) values["tracking_gap_s"] = input.needle.longest_gap_s;
    const std::size_t back = input.probe.run_back + input.needle.run_back;
    if (back > 0) {
        warnings.push_back(std::to_string(back) +
                           " readings were left out, because their time ran backwards or their "
                           "pose was not finite.");
    }
    if (!input.anatomy)
        warnings.push_back("No body was given, so scores that need one are undefined.");
}

SessionCurves curves_of(const ScoreInput& input) {
    SessionCurves c;
    for (std::size_t i = 0; i < input.readings.size(); ++i) {
        const NeedleReading& r = input.readings[i];
        c.time_s.push_back(input.time(i));
        c.depth_mm.push_back(input.anatomy ? std::max(r.depth_mm, 0.0) : kNan);
        c.plane_distance_mm.push_back(r.plane_mm);
        c.in_beam_fraction.push_back(r.seen && r.depth_mm > 0 ? r.in_beam_mm / r.depth_mm : kNan);
        double nearest = kNan;
        // With many targets the curve of the nearest one says little and is expensive.
        if (input.exercise.targets.size() <= 64) {
            for (std::size_t t = 0; t < input.exercise.targets.size(); ++t) {
                const double d = distance(input.target_at(t, input.time(i)), input.tip(i));
                if (!(d >= nearest)) nearest = d;
            }
        }
        c.tip_to_target_mm.push_back(nearest);
    }
    return c;
}

// Metrics in the order of their table, then pass marks.
void finish(const Exercise& exercise, const MetricValues& values, SessionScore& out) {
    for (const MetricInfo& info : metric_table()) {
        const auto found = values.find(info.name);
        out.metrics.push_back({info.name, found == values.end() ? kNan : found->second});
    }
    for (const Exercise::PassMark& mark : exercise.pass_marks) {
        PassResult result{mark.metric, out.value(mark.metric), mark.at_most, mark.at_least, false};
        result.passed = result.value <= mark.at_most && result.value >= mark.at_least;  // NaN fails
        out.passed = out.passed && result.passed;
        out.pass_marks.push_back(std::move(result));
    }
}

}  // namespace

double SessionScore::value(std::string_view name) const {
    for (const Metric& metric : metrics) {
        if (metric.name == name) return metric.value;
    }
    return kNan;
}

SessionScore score_session(const Session& session,
                           const Exercise& exercise,
                           const Anatomy* anatomy,
                           const std::vector<Label>& labels,
                           const ScoreOptions& options) {
    ScoreInput input{session,
                     exercise,
                     anatomy,
                     options,
                     track_of(session, Tool::probe),
                     track_of(session, Tool::drawn_needle),
                     {}};
    input.readings = look_up_readings(session, input.needle, exercise, anatomy, labels, options);
    const bool has_no_go = std::any_of(labels.begin(), labels.end(), [&](const Label& label) {
        return std::count(exercise.no_go.begin(), exercise.no_go.end(), label.name) > 0;
    });
    MetricValues values;
    SessionScore out;
    score_times(input, values, out.warnings);
    detail::score_motion("needle_", input.needle, options.motion, values);
    detail::score_motion("probe_", input.probe, options.motion, values);
    const bool has_needle = !input.needle.points.empty(), has_probe = !input.probe.points.empty();
    if (has_needle || has_probe) out.targets.resize(exercise.targets.size());
    if (has_needle) {
        detail::score_tissue(input, has_no_go, values, out.warnings);
        out.insertions = detail::find_insertions(input);
        if (anatomy) values["insertions"] = static_cast<double>(out.insertions.size());
        detail::score_targets_hit(input, out.insertions, values, out.targets);
        detail::score_guidance(input, values);
    }
    detail::score_probe_use(input, values);
    detail::score_targets_scanned(input, values, out.targets);
    detail::score_press(input, values);
    detail::score_doppler(input, values);
    out.curves = curves_of(input);
    finish(exercise, values, out);
    return out;
}

}  // namespace sonocase
