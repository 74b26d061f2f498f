// SPDX-License-Identifier: Apache-2.0

#include "formats/flow/flow_summary.h"

#include <algorithm>
#include <cmath>

#include "formats/base/constants.h"
#include "formats/flow/flow_velocity.h"

namespace sonocase {
namespace {

double length_mm(const FlowField& field, const FlowVessel& vessel) {
    double sum = 0;
    for (int i = 0; i + 1 < vessel.nodes; ++i) {
        const auto at = static_cast<std::size_t>(vessel.first_node + i);
        sum += distance(field.nodes[at].centre, field.nodes[at + 1].centre);
    }
    return sum;
}

}  // namespace

const char* name_of(FlowKind kind) {
    constexpr std::array<const char*, 3> kNames{"artery", "vein", "portal"};
    return kNames[static_cast<std::size_t>(kind)];
}

std::vector<VesselSummary> vessel_summaries(const FlowField& field, double beat_s) {
    std::vector<VesselSummary> out;
    std::array<VesselSummary, 3> grown;
    std::array<int, 3> count{};
    for (const FlowVessel& vessel : field.vessels) {
        const auto kind = static_cast<std::size_t>(vessel.kind);
        VesselSummary s;
        s.name = vessel.name;
        s.kind = vessel.kind;
        s.course = vessel.nodes > 0;
        s.mean_ml_min = 60 * vessel.mean_ml_s;
        if (s.course) {
            const double area = median_area_mm2(field, vessel);
            const VelocityRange v = velocity_range(vessel, area, beat_s);
            s.length_mm = length_mm(field, vessel);
            s.diameter_mm = 2 * std::sqrt(area / kPi);
            s.mean_cm_s = v.mean / 10;
            s.peak_cm_s = v.peak / 10;
            s.end_cm_s = v.end / 10;
            s.resistive_index = v.peak > 0 ? (v.peak - v.end) / v.peak : 0;
        }
        if (!vessel.round || !s.course) {
            out.push_back(s);
            continue;
        }
        // A grown tree shows its thickest vessel and its whole length.
        VesselSummary& sum = grown[kind];
        const double length = sum.length_mm + s.length_mm;
        if (count[kind]++ == 0 || s.diameter_mm > sum.diameter_mm) sum = s;
        sum.length_mm = length;
    }
    for (std::size_t kind = 0; kind < grown.size(); ++kind) {
        if (count[kind] == 0) continue;
        grown[kind].name += " and " + std::to_string(count[kind] - 1) + " branches";
        out.push_back(grown[kind]);
    }
    return out;
}

double worst_balance(const FlowField& field) {
    const auto junctions = static_cast<std::size_t>(std::max(field.junctions, 0));
    double worst = 0;
    for (int step = 0; step < 64; ++step) {
        const double phase = step / 64.0, inspired = step % 3 * 0.5;
        std::vector<double> sum(junctions, 0.0), greatest(junctions, 0.0);
        for (const FlowVessel& vessel : field.vessels) {
            const double q = flow_ml_s(vessel, phase, inspired);
            for (const auto& [junction, sign] : {std::pair{vessel.to, 1}, {vessel.from, -1}}) {
                if (junction < 0) continue;
                const auto j = static_cast<std::size_t>(junction);
                sum[j] += sign * q;
                greatest[j] = std::max(greatest[j], std::abs(vessel.mean_ml_s));
            }
        }
        for (std::size_t j = 0; j < junctions; ++j)
            if (greatest[j] > 0) worst = std::max(worst, std::abs(sum[j]) / greatest[j]);
    }
    return worst;
}

}  // namespace sonocase
