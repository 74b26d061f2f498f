// SPDX-License-Identifier: Apache-2.0

#include "runtime/imaging/press/press_view.h"

#include <algorithm>

namespace sonocase::runtime::press {

PressView::PressView(const ScanGeometry& g, const PressFace& face)
    : geometry(&g),
      columns_follow_beams(follows_columns(g)),
      samples(g.samples),
      lines((g.scanlines + kPressBeams - 1) / kPressBeams * kPressBeams),
      step_mm(static_cast<float>(g.step_mm)),
      columns_per_mm(static_cast<float>(1 / column_width_mm(face))),
      per_radius_mm(g.fan && g.radius_mm > 0 ? static_cast<float>(1 / g.radius_mm) : 0.0f) {
    constexpr double kDeepest_mm = (kTableRows - 1) * kTableStep_mm + kTableFade_mm;
    const int moving = static_cast<int>(kDeepest_mm / g.step_mm + 0.5) + 1;
    active = std::min(samples, (moving + kPressRows - 1) / kPressRows * kPressRows);
    if (!columns_follow_beams) return;
    for (int l = 0; l < lines; ++l) {
        const double lateral = lateral_of_line(g, std::min(l, g.scanlines - 1));
        column.push_back(
            static_cast<float>(lateral / column_width_mm(face) + (kColumns - 1) / 2.0));
    }
    shift.assign(static_cast<std::size_t>(active) * kStride, 0.0f);
    bulge.assign(static_cast<std::size_t>(kBulgeRows) * static_cast<std::size_t>(lines), 0.0f);
    for (int k = 0; k < samples; ++k) {
        const double beyond =
            std::max(0.0, (k + 0.5) * g.step_mm - (kTableRows - 1) * kTableStep_mm);
        share.push_back(static_cast<float>(std::max(0.0, 1 - beyond / kTableFade_mm)));
    }
}

PressView::Shift PressView::at(int line, int k) const {
    if (!columns_follow_beams) {
        const PlaneShift s =
            plane_shift(*field, *geometry, geometry->beams[static_cast<std::size_t>(line)], line,
                        (k + 0.5) * geometry->step_mm);
        return {static_cast<float>(s.along_mm), static_cast<float>(s.side_mm)};
    }
    constexpr float kPerRow = static_cast<float>(1 / (kBulgeEvery * kTableStep_mm));
    const float r = (static_cast<float>(k) + 0.5f) * step_mm;
    const float row = std::min(r * kPerRow, kBulgeRows - 1.0f);
    const int n = std::min(static_cast<int>(row), kBulgeRows - 2);
    const float* above = bulge.data() + static_cast<std::ptrdiff_t>(n) * lines + line;
    const float v = share[static_cast<std::size_t>(k)] *
                    (above[0] + (row - static_cast<float>(n)) * (above[lines] - above[0]));
    const float c = std::clamp(column[static_cast<std::size_t>(line)] + v * columns_per_mm, 0.0f,
                               kColumns - 1.0f);
    const int i = std::min(static_cast<int>(c), kColumns - 2);
    const float left = shift_row(k)[i], right = shift_row(k)[i + 1];
    const float deeper = left + (c - static_cast<float>(i)) * (right - left);
    const float grow = 1 + (r + deeper) * per_radius_mm;
    return {deeper - 0.5f * v * v * per_radius_mm * grow, v * grow};
}

void PressView::show(const PressField& pressed) {
    field = &pressed;
    if (!columns_follow_beams) return;
    const PressTable& table = pressed.table();
    for (int k = 0; k < active; ++k) {
        const float r = (static_cast<float>(k) + 0.5f) * step_mm;
        constexpr float kPerStep = static_cast<float>(1 / kTableStep_mm);
        const float at = std::min(r * kPerStep, kTableRows - 1.0f);
        const int m = std::min(static_cast<int>(at), kTableRows - 2);
        const float part = at - static_cast<float>(m), weight = share[static_cast<std::size_t>(k)];
        const float depth = at * static_cast<float>(kTableStep_mm);
        const float *upper = table.rest_mm.row(m), *lower = table.rest_mm.row(m + 1);
        float* out = shift.data() + k * kStride + kMargin;
        for (int i = 0; i < kColumns; ++i)
            out[i] = weight * (upper[i] + part * (lower[i] - upper[i]) - depth);
    }
    for (int n = 0; n < kBulgeRows; ++n) {
        const float* row = table.bulge_mm.row(n);
        float* out = bulge.data() + static_cast<std::ptrdiff_t>(n) * lines;
        for (int l = 0; l < lines; ++l) {
            const float c = column[static_cast<std::size_t>(l)];
            const int i = static_cast<int>(c);
            out[l] = -(row[i] + (c - static_cast<float>(i)) * (row[i + 1] - row[i]));
        }
    }
}

}  // namespace sonocase::runtime::press
