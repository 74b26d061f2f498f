// SPDX-License-Identifier: Apache-2.0

#include <algorithm>
#include <cmath>

#include "pipeline/aim/aim.h"
#include "pipeline/pictures/png.h"

namespace sonocase::pipeline {
namespace {

constexpr int kPanelPx = 360;

}  // namespace

std::vector<std::uint8_t> aim_picture(const CaseLabels& labels,
                                      const AimTarget& target,
                                      const AimResult& result) {
    const int panels = std::max(1, std::min<int>(3, static_cast<int>(result.windows.size())));
    std::vector<std::uint8_t> rgb(static_cast<std::size_t>(3 * panels * kPanelPx * kPanelPx), 0);
    const int width = panels * kPanelPx;
    for (int n = 0; n < std::min<int>(panels, static_cast<int>(result.windows.size())); ++n) {
        const AimWindow& w = result.windows[static_cast<std::size_t>(n)];
        const double mm = (w.depth_mm + 70) / kPanelPx;  // per pixel
        const auto plot = [&](int x, int y, std::array<std::uint8_t, 3> colour) {
            if (x < 0 || y < 0 || x >= kPanelPx || y >= kPanelPx) return;
            const auto at = static_cast<std::size_t>(3 * (y * width + n * kPanelPx + x));
            std::copy(colour.begin(), colour.end(), rgb.begin() + static_cast<std::ptrdiff_t>(at));
        };
        for (int y = 0; y < kPanelPx; ++y)
            for (int x = 0; x < kPanelPx; ++x) {
                const Point3 p =
                    w.skin + (x - kPanelPx / 2) * mm * w.lateral + (y * mm - 25) * w.beam;
                plot(x, y,
                     labels.bundle().labels[static_cast<std::size_t>(labels.label(p))].colour);
            }
        const auto stroke = [&](Point3 from, Point3 to, std::array<std::uint8_t, 3> colour) {
            for (int s = 0; s <= 800; ++s) {
                const Vector3 at = from + (s / 800.0) * (to - from) - w.skin;
                const int x = static_cast<int>(std::lround(dot(at, w.lateral) / mm)) + kPanelPx / 2;
                const int y = static_cast<int>(std::lround((dot(at, w.beam) + 25) / mm));
                plot(x, y, colour);
                plot(x + 1, y, colour);
            }
        };
        stroke(w.skin - 25 * w.lateral, w.skin + 25 * w.lateral, {255, 255, 255});
        stroke(w.skin, target.centre, {255, 255, 0});
        if (w.needle) stroke(w.entry - 30 * w.needle_direction, target.centre, {0, 255, 255});
        for (int s = 0; s < 360; ++s) {
            const double a = s * 3.14159265 / 180;
            const Point3 p = target.centre + target.radius_mm * std::cos(a) * w.lateral +
                             target.radius_mm * std::sin(a) * w.beam;
            stroke(p, p, {255, 0, 0});
        }
    }
    return png_from_rgb(rgb.data(), width, kPanelPx);
}

}  // namespace sonocase::pipeline
