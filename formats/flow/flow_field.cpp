// SPDX-License-Identifier: Apache-2.0

#include "formats/flow/flow_field.h"

#include "formats/base/constants.h"

namespace sonocase {

std::vector<SectionAxes> section_axes(const FlowField& field, const FlowVessel& vessel) {
    std::vector<SectionAxes> axes;
    Vector3 first;
    for (int i = 0; i < vessel.nodes; ++i) {
        const Vector3 d = field.nodes[vessel.first_node + i].direction;
        Vector3 across = first - dot(first, d) * d;
        // There is no `first` at the first node, nor where a vessel turns by a right angle in one
        // step.
        if (!(norm(across) > 1e-6)) across = any_perpendicular(d);
        first = normalized(across);
        axes.push_back({first, cross(d, first)});
    }
    return axes;
}

double section_area_mm2(const std::array<float, kFlowRays>& radius_mm) {
    double sum = 0;
    for (std::size_t i = 0; i < kFlowRays; ++i) {
        const auto a = static_cast<double>(radius_mm[i]),
                   b = static_cast<double>(radius_mm[(i + 1) % kFlowRays]);
        sum += (a * a + a * b + b * b) / 3;
    }
    return kPi / kFlowRays * sum;
}

double wave_at(const FlowWave& wave, double phase) {
    double q = 1;
    for (int h = 1; h <= kFlowHarmonics; ++h) {
        const FlowHarmonic& c = wave[h - 1];
        const double angle = 2 * kPi * h * (phase - std::floor(phase));
        q += static_cast<double>(c.re) * std::cos(angle) -
             static_cast<double>(c.im) * std::sin(angle);
    }
    return q;
}

double flow_ml_s(const FlowVessel& vessel, double phase, double inspired) {
    return vessel.mean_ml_s *
           (wave_at(vessel.wave, phase) + static_cast<double>(vessel.breathing) * (0.5 - inspired));
}

double inspired_at(double time_s, double period_s) {
    if (!(period_s > 0) || !std::isfinite(time_s)) return 0;
    return 0.5 * (1 - std::cos(2 * kPi * time_s / period_s));
}

}  // namespace sonocase
