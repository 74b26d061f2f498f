// SPDX-License-Identifier: Apache-2.0

#include "runtime/imaging/doppler/colour_estimate.h"

#include <algorithm>

#include "formats/flow/flow_velocity.h"

namespace sonocase::runtime::doppler {

WallFilter::WallFilter(double cut_off) {
    const double part = std::isfinite(cut_off) ? std::clamp(cut_off, 0.0, 0.9) : 0.0;
    // No cut-off: everything passes that moves at all.
    per_sine_ = static_cast<float>(part > 0 ? 1 / unit_circle(part / 4).sine : 1e6);
}

Ensemble::Ensemble(int count) : pulses(std::clamp(count, 4, kMaxPulses)) {
    // Projection on 1 and on the line through the pulses: P_ij = 1/N + t_i t_j / sum t^2.
    const double n = pulses, middle = (n - 1) / 2;
    double square = 0, beside = 0;
    for (int i = 0; i < pulses; ++i) square += (i - middle) * (i - middle);
    for (int i = 0; i + 1 < pulses; ++i) beside += 1 / n + (i - middle) * (i + 1 - middle) / square;
    r0 = static_cast<float>(1 - 2 / n);
    r1 = static_cast<float>(-beside / (n - 1));
}

}  // namespace sonocase::runtime::doppler
