// SPDX-License-Identifier: Apache-2.0

#include "runtime/imaging/physical/model/scan_reach.h"

#include <algorithm>
#include <cmath>

namespace sonocase::runtime {
namespace {

constexpr double kDeviations = 4;  // most of the random step: its noise is bytes of 1/32

}  // namespace

ScanReach::ScanReach(const ScanGeometry& g, const physical::Tables& t, double voxel_mm)
    : fan_(g.fan), radius_mm_(g.radius_mm), half_extent_(g.half_extent) {
    // Where a gap to the skin closes, the tissue behind it moves up, less with depth.
    const double pressed = physical::kMaxGapMm * std::exp(-g.depth_mm / physical::kGapReachMm);
    // The random step of a look-up, and half a voxel to each side.
    const double rim = (kDeviations * physical::kLookupJitter + 1) * voxel_mm + 0.1;
    deepest_mm_ = g.depth_mm + pressed + rim;
    for (const physical::Row& row : t.rows)
        thick_mm_ = std::max(thick_mm_, kDeviations * row.elevation_mm);
    thick_mm_ += rim;
}

ScanReach::View ScanReach::seen(const Grid& grid,
                                int edge,
                                const Rigid& volume_from_probe,
                                double shift_mm) const {
    const Rigid probe_from_volume = inverse(volume_from_probe);
    const double middle = 0.5 * (edge - 1);
    const auto at = [&](double i, double j, double k) {
        return probe_from_volume * grid.point_from_voxel({middle + i, middle + j, middle + k});
    };
    View view;
    view.first = at(0, 0, 0);
    view.step[0] = at(1, 0, 0) - view.first;
    view.step[1] = at(0, 1, 0) - view.first;
    view.step[2] = at(0, 0, 1) - view.first;
    const Vector3* s = view.step;
    view.radius_mm = std::sqrt(3.0) * 0.5 * edge * norm(s[0]) + shift_mm;
    view.across_mm =
        0.5 * edge * (std::abs(s[0].y) + std::abs(s[1].y) + std::abs(s[2].y)) + shift_mm;
    return view;
}

bool ScanReach::reaches_along(const View& view, Int3 lower) const noexcept {
    const Point3 c = view.first + (static_cast<double>(lower.x) * view.step[0] +
                                   static_cast<double>(lower.y) * view.step[1] +
                                   static_cast<double>(lower.z) * view.step[2]);
    // thick_mm_ bounds the random step in the plane as well.
    const double ball = view.radius_mm + thick_mm_;
    if (!fan_)
        return std::abs(c.x) < half_extent_ + ball && c.z > -ball && c.z < deepest_mm_ + ball;
    const double z = c.z + radius_mm_, range = std::hypot(c.x, z);
    if (range > radius_mm_ + deepest_mm_ + view.radius_mm || range < radius_mm_ - ball)
        return false;
    if (range <= ball) return true;
    return std::abs(std::atan2(c.x, z)) < half_extent_ + std::asin(ball / range);
}

}  // namespace sonocase::runtime
