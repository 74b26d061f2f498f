// SPDX-License-Identifier: Apache-2.0

#include "formats/image_scores/motion_scores.h"

#include <algorithm>
#include <cassert>
#include <cmath>

#include "formats/image_scores/smooth.h"

namespace sonocase {
namespace {

// Grey less its trend in a rectangle, as far as the picture reaches.
struct Detail {
    int first_sample, first_line, rows, columns;
    std::vector<float> values;
    float at(int sample, int line) const {
        return values[static_cast<std::size_t>(sample - first_sample) *
                          static_cast<std::size_t>(columns) +
                      static_cast<std::size_t>(line - first_line)];
    }
    bool holds(int sample, int line) const {
        return sample >= first_sample && line >= first_line &&
               sample + kPatch <= first_sample + rows && line + kPatch <= first_line + columns;
    }
};

Detail detail_round(const BeamImage& image, PatchPlace place, int margin) {
    Detail d;
    d.first_sample = std::max(place.sample - margin, 0);
    d.first_line = std::max(place.line - margin, 0);
    d.rows = std::min(place.sample + kPatch + margin, image.samples) - d.first_sample;
    d.columns = std::min(place.line + kPatch + margin, image.lines) - d.first_line;
    for (int k = d.first_sample; k < d.first_sample + d.rows; ++k) {
        for (int l = d.first_line; l < d.first_line + d.columns; ++l)
            d.values.push_back(image.at(k, l));
    }
    const auto trend = gaussian_smoothed(d.values, d.rows, d.columns, kTrendSamples, kTrendSamples);
    for (std::size_t i = 0; i < trend.size(); ++i) d.values[i] -= trend[i];
    return d;
}

}  // namespace

DetailMatch match_detail(const BeamImage& before,
                         const BeamImage& after,
                         PatchPlace place,
                         int reach) {
    assert(before.samples == after.samples && before.lines == after.lines);
    const Detail a = detail_round(before, place, reach), b = detail_round(after, place, reach);
    DetailMatch best;
    best.correlation = -2;
    for (int dk = -reach; dk <= reach; ++dk) {
        for (int dl = -reach; dl <= reach; ++dl) {
            if (!b.holds(place.sample + dk, place.line + dl)) continue;
            double sa = 0, sb = 0, aa = 0, bb = 0, ab = 0;
            for (int k = 0; k < kPatch; ++k) {
                for (int l = 0; l < kPatch; ++l) {
                    const double x = static_cast<double>(a.at(place.sample + k, place.line + l)),
                                 y = static_cast<double>(
                                     b.at(place.sample + k + dk, place.line + l + dl));
                    sa += x;
                    sb += y;
                    aa += x * x;
                    bb += y * y;
                    ab += x * y;
                }
            }
            constexpr double n = kPatch * kPatch;
            const double power = (aa - sa * sa / n) * (bb - sb * sb / n);
            const double c = power > 1e-9 ? (ab - sa * sb / n) / std::sqrt(power) : 0;
            if (c > best.correlation) best = {c, dk, dl};
        }
    }
    return best;
}

}  // namespace sonocase
