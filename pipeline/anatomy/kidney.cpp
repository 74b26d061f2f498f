// SPDX-License-Identifier: Apache-2.0

#include "pipeline/anatomy/kidney.h"

#include <algorithm>
#include <cmath>
#include <cstdint>

#include "formats/base/constants.h"

namespace sonocase::pipeline::inline anatomy {

Kidney find_kidney(const LabelVolume& labels, const LabelFacts& facts, int label) {
    const double voxel_mm = labels.grid.spacing_mm.x;
    const int margin = static_cast<int>(std::ceil(16 / voxel_mm));
    const int step = std::max(1, static_cast<int>(std::lround(1.6 / voxel_mm)));
    Kidney kidney;
    kidney.label = label;
    const Int3 size = labels.grid.size;
    const Int3 lower{facts.lower.x - margin, facts.lower.y - margin, facts.lower.z - margin};
    const Int3 extent{facts.upper.x + margin - lower.x + 1, facts.upper.y + margin - lower.y + 1,
                      facts.upper.z + margin - lower.z + 1};
    const auto is_kidney = [&](int i, int j, int k) {
        // A kidney that the grid cuts continues beyond it.
        i = std::clamp(i + lower.x, 0, size.x - 1);
        j = std::clamp(j + lower.y, 0, size.y - 1);
        k = std::clamp(k + lower.z, 0, size.z - 1);
        return labels.voxels[labels.grid.index(i, j, k)] == label;
    };
    // Hull: closing by a ball of 11 mm, in two distance transforms on the coarse samples.
    const CoarseField to_kidney =
        distance_inside(extent, step, [&](int i, int j, int k) { return !is_kidney(i, j, k); });
    const auto ball = static_cast<float>(11 / voxel_mm);
    const auto dilated = [&](int i, int j, int k) {
        return to_kidney.at(static_cast<float>(i), static_cast<float>(j), static_cast<float>(k)) <
               ball;
    };
    CoarseField depth = distance_inside(extent, step, dilated);
    for (float& d : depth.value) d = std::max(d - ball, 0.f);
    kidney.depth = {lower,
                    {lower.x + extent.x - 1, lower.y + extent.y - 1, lower.z + extent.z - 1},
                    std::move(depth)};
    std::int64_t hull = 0, filled = 0;  // samples
    Vector3 hilum{0, 0, 0};             // of the samples in the hull that are not kidney
    double hilum_weight = 0;
    const CoarseField& d = kidney.depth.field;
    for (int k = 0; k < d.size.z; ++k) {
        for (int j = 0; j < d.size.y; ++j) {
            for (int i = 0; i < d.size.x; ++i) {
                const float v = d.value[d.index(i, j, k)];
                kidney.deepest = std::max(kidney.deepest, static_cast<double>(v));
                if (v < 1.5f * static_cast<float>(step)) continue;
                ++hull;
                if (is_kidney(i * step, j * step, k * step)) {
                    ++filled;
                } else {
                    hilum = hilum + Vector3{static_cast<double>(lower.x + i * step),
                                            static_cast<double>(lower.y + j * step),
                                            static_cast<double>(lower.z + k * step)};
                    hilum_weight += 1;
                }
            }
        }
    }
    kidney.solid =
        hull > 0 && static_cast<double>(hull - filled) < 0.03 * static_cast<double>(hull);
    kidney.centre = facts.mean;
    const Vector3 along = facts.axes.column(0);
    Vector3 towards =
        hilum_weight > 0 ? (1 / hilum_weight) * hilum - facts.mean : facts.axes.column(2);
    towards = towards - dot(towards, along) * along;
    if (norm(towards) < 0.5) towards = facts.axes.column(2);
    towards = normalized(towards);
    kidney.axes = Matrix3::from_columns(along, towards, cross(along, towards));
    kidney.half_length = 1.9 * facts.spread.x;
    return kidney;
}

float kidney_offset_db(const Kidney& kidney, float voxel_mm, int i, int j, int k, float noise) {
    const float depth = kidney.depth.at(i, j, k) * voxel_mm + 0.9f * noise;  // irregular borders
    const auto deepest = static_cast<float>(kidney.deepest) * voxel_mm;
    const Vector3 p =
        Vector3{static_cast<double>(i), static_cast<double>(j), static_cast<double>(k)} -
        kidney.centre;
    const double along = dot(p, kidney.axes.column(0)) * voxel_mm;
    const double a = dot(p, kidney.axes.column(1)), b = dot(p, kidney.axes.column(2));
    const auto ramp = [](float x) { return std::clamp(x, 0.f, 1.f); };
    if (kidney.solid) {
        // The sinus is drawn inside: the deepest third, open towards the hilum.
        const float shift = a > 0 ? 0.10f * deepest : 0.f;
        const float sinus = ramp((depth + shift - 0.66f * deepest) / 1.5f + 0.5f);
        if (sinus >= 1) return 11;
        if (sinus > 0) return 11 * sinus;
    }
    const float cortex = std::min(7.f, 0.34f * deepest);
    const float reach = std::max(std::min(kidney.solid ? 0.62f * deepest : 20.f, 20.f), cortex + 1);
    const float s =
        (depth - cortex) / (reach - cortex);  // 0 at the base of a pyramid, 1 at its tip
    if (s <= -0.15f || s >= 1.1f) return 0;
    // Rows of pyramids about 17 mm apart along the kidney, five around it, staggered.
    const double row = along / 17.0;
    const double row_index = std::floor(row);
    const double stagger = 0.5 * (static_cast<long>(row_index) & 1);
    double turn = std::atan2(b, a) / (2 * kPi) * 5 + stagger;
    turn -= std::floor(turn);
    const double du = (row - row_index - 0.5), dv = turn - 0.5;
    const auto across = static_cast<float>(std::sqrt(du * du + dv * dv));
    const float half_width = 0.44f * (1 - 0.62f * ramp(s)) + 0.05f * noise;
    const float inside = ramp((half_width - across) / 0.10f + 0.5f);
    const float ends = ramp((s + 0.12f) / 0.18f) * ramp((1.08f - s) / 0.15f);
    return -5.f * inside * ends;
}

}  // namespace sonocase::pipeline::inline anatomy
