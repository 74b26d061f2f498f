// SPDX-License-Identifier: Apache-2.0

#include <algorithm>
#include <optional>

#include "formats/scoring/score_parts.h"
#include "formats/volume/tissue_mechanics.h"

namespace sonocase::detail {
namespace {

// Of a vein's area at rest: its walls touch, and it is open again.
constexpr double kShut = 0.1, kOpen = 0.5;

void score_force(const ScoreInput& input, MetricValues& values) {
    double pressed_s = 0, over_s = 0, force_sum = 0, pressure_sum = 0, greatest = 0;
    double before_s = 0;
    bool first = true;
    for (const SessionSample& sample : input.session.samples) {
        if (!sample.has_press || !sample.probe_ok) continue;
        const double step_s = first ? 0 : std::max(sample.time_s - before_s, 0.0);
        first = false;
        before_s = sample.time_s;
        greatest = std::max(greatest, sample.press.force_n);
        if (!(sample.press.force_n > 0)) continue;
        pressed_s += step_s;
        force_sum += step_s * sample.press.force_n;
        pressure_sum += step_s * sample.press.pressure_kpa;
        if (sample.press.force_n > input.exercise.deformation.force_limit_n) over_s += step_s;
    }
    values["probe_force_max_n"] = greatest;
    values["probe_force_mean_n"] = pressed_s > 0 ? force_sum / pressed_s : 0;
    values["probe_pressure_mean_kpa"] = pressed_s > 0 ? pressure_sum / pressed_s : 0;
    values["press_time_over_limit_s"] = over_s;
}

// Times that the veins under the face were shut and opened again.
double compressions(const Session& session) {
    int done = 0;
    bool shut = false;
    for (const SessionSample& sample : session.samples) {
        if (!sample.has_press) continue;
        const double open = sample.press.vein_open;
        if (open >= 0 && open < kShut) shut = true;
        const bool lifted = !(sample.press.force_n > 0);
        if (shut && (lifted || open > kOpen)) {
            ++done;
            shut = false;
        }
    }
    return done;
}

const SessionSample* sample_at(const Session& session, std::int64_t frame) {
    for (const SessionSample& sample : session.samples) {
        if (sample.frame == frame) return &sample;
    }
    return nullptr;
}

void score_vessels(const ScoreInput& input, MetricValues& values) {
    double posterior = 0;
    std::optional<std::string> vessel;  // the first that was punctured
    for (const SessionEvent& event : input.session.events) {
        if (event.name == "posterior_wall") ++posterior;
        if (event.name != "tissue_puncture" || vessel) continue;
        const std::string label = detail_value(event.detail, "label");
        const Vessel kind = vessel_of_label(label);
        if (kind == Vessel::unknown) continue;
        vessel = label;
        const SessionSample* sample = sample_at(input.session, event.frame);
        if (kind != Vessel::vein || sample == nullptr) continue;
        const double open = sample->press.vein_open;
        values["vein_collapse_at_puncture_percent"] =
            open >= 0 ? 100 * (1 - std::min(open, 1.0)) : 0;
    }
    values["posterior_wall_punctures"] = posterior;
    if (!vessel) return;
    bool any = false, right = false;
    for (const Target& target : input.exercise.targets) {
        if (vessel_of_label(target.inside) == Vessel::unknown) continue;
        any = true;
        right = right || target.inside == *vessel;
    }
    if (any) values["correct_vessel_punctured"] = right ? 1 : 0;
}

}  // namespace

void score_press(const ScoreInput& input, MetricValues& values) {
    const auto& samples = input.session.samples;
    if (std::none_of(samples.begin(), samples.end(),
                     [](const SessionSample& sample) { return sample.has_press; }))
        return;
    score_force(input, values);
    values["compressions_done"] = compressions(input.session);
    if (!input.needle.points.empty()) score_vessels(input, values);
}

}  // namespace sonocase::detail
