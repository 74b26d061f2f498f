// SPDX-License-Identifier: Apache-2.0

// Part 6 of docs/metrics.md: which vessels were shown in colour, where the spectral gate stood, and
// what was measured with it.
#include <algorithm>
#include <cmath>
#include <map>

#include "formats/scoring/score_parts.h"
#include "formats/volume/tissue_mechanics.h"

namespace sonocase::detail {
namespace {

constexpr double kShownS = 1;  // in colour for this long: more than a beat
constexpr int kLeastBeats = 2;

bool among(const std::vector<std::string>& names, const std::string& name) {
    return std::find(names.begin(), names.end(), name) != names.end();
}

// Doppler saw blood run in it: a tube of a phantom is a vessel by that alone.
bool flows(const Session& session, const std::string& label) {
    return std::any_of(session.samples.begin(), session.samples.end(), [&](const auto& sample) {
        return sample.has_doppler &&
               (sample.doppler.gate == label || among(sample.doppler.coloured, label));
    });
}

// Vessels that targets lie in, each once.
std::vector<std::string> wanted_vessels(const Exercise& exercise, const Session& session) {
    std::vector<std::string> wanted;
    for (const Target& target : exercise.targets) {
        if (target.inside.empty() || among(wanted, target.inside)) continue;
        if (vessel_of_label(target.inside) != Vessel::unknown || flows(session, target.inside))
            wanted.push_back(target.inside);
    }
    return wanted;
}

struct Watch {
    std::map<std::string, double> coloured_s;       // of each vessel
    std::map<std::string, DopplerSample> measured;  // the last measurement in each
    double gate_s = 0, filled_s = 0;                // spectral time; in a wanted vessel
};

Watch watch(const Session& session, const std::vector<std::string>& wanted) {
    Watch out;
    const SessionSample* before = nullptr;
    for (const SessionSample& sample : session.samples) {
        const double step_s = before != nullptr ? std::max(sample.time_s - before->time_s, 0.0) : 0;
        before = &sample;
        if (!sample.has_doppler) continue;
        const DopplerSample& d = sample.doppler;
        for (const std::string& vessel : d.coloured) out.coloured_s[vessel] += step_s;
        // A frame of a spectral mode says how its cursor stands, a frame of colour does not.
        if (d.gate.empty() && d.cursor_deg == 0) continue;
        out.gate_s += step_s;
        if (among(wanted, d.gate)) out.filled_s += step_s * d.gate_fill;
        if (!d.gate.empty() && d.beats >= kLeastBeats) out.measured[d.gate] = d;
    }
    return out;
}

}  // namespace

void score_doppler(const ScoreInput& input, MetricValues& values) {
    const auto& samples = input.session.samples;
    if (std::none_of(samples.begin(), samples.end(),
                     [](const SessionSample& sample) { return sample.has_doppler; }))
        return;
    const std::vector<std::string> wanted = wanted_vessels(input.exercise, input.session);
    const Watch seen = watch(input.session, wanted);
    double shown = 0, measured = 0, angle = 0, cursor = 0, error = 0;
    for (const std::string& vessel : wanted) {
        const auto colour = seen.coloured_s.find(vessel);
        if (colour != seen.coloured_s.end() && colour->second >= kShownS) ++shown;
        const auto found = seen.measured.find(vessel);
        if (found == seen.measured.end()) continue;
        const DopplerSample& d = found->second;
        ++measured;
        angle = std::max(angle, d.angle_deg);
        cursor = std::max(cursor, std::abs(d.cursor_deg - d.angle_deg));
        if (d.true_psv_cm_s > 0)
            error = std::max(error, 100 * std::abs(d.psv_cm_s / d.true_psv_cm_s - 1));
    }
    values["vessels_shown_in_colour"] = shown;
    values["vessels_measured"] = measured;
    if (seen.gate_s > 0) values["gate_in_vessel_fraction"] = seen.filled_s / seen.gate_s;
    if (!seen.measured.empty() && !wanted.empty())
        values["correct_vessel_measured"] =
            std::all_of(seen.measured.begin(), seen.measured.end(),
                        [&](const auto& one) { return among(wanted, one.first); });
    if (measured == 0) return;
    values["doppler_angle_max_deg"] = angle;
    values["angle_cursor_error_deg"] = cursor;
    values["peak_velocity_error_percent"] = error;
}

}  // namespace sonocase::detail
