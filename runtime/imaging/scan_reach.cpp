#include "runtime/imaging/scan_reach.h"

#include <algorithm>
#include <cmath>

namespace sonocase::runtime {
namespace {

constexpr double kDeviations = 4;  // of the jitter: its noise is bytes of 1/32

}  // namespace

ScanReach::ScanReach(const ScanGeometry& g, const physical::Tables& t, double voxel_mm)
    : fan_(g.fan), radius_mm_(g.radius_mm), half_extent_(g.half_extent) {
    // A gap to the skin closes: what lies behind it moves up, less with depth.
    const double pressed = physical::kMaxGapMm * std::exp(-g.depth_mm / physical::kGapReachMm);
    // The nearest voxel of a place that jitters.
    const double rim = (kDeviations * physical::kLookupJitter + 1) * voxel_mm + 0.1;
    deepest_mm_ = g.depth_mm + pressed + rim;
    for (const physical::Row& row : t.rows)
        thick_mm_ = std::max(thick_mm_, kDeviations * row.elevation_mm);
    thick_mm_ += rim;
}

bool ScanReach::reaches(Point3 c, double radius_mm, double across_mm) const noexcept {
    if (std::abs(c.y) > thick_mm_ + across_mm) return false;
    // thick_mm_ stands for the jitter in the plane too: it is more.
    const double ball = radius_mm + thick_mm_;
    if (!fan_) return std::abs(c.x) < half_extent_ + ball && c.z > -ball && c.z < deepest_mm_ + ball;
    const double z = c.z + radius_mm_, range = std::hypot(c.x, z);
    if (range > radius_mm_ + deepest_mm_ + radius_mm || range < radius_mm_ - ball) return false;
    if (range <= ball) return true;
    return std::abs(std::atan2(c.x, z)) < half_extent_ + std::asin(ball / range);
}

bool ScanReach::reaches(const Grid& grid,
                        Int3 lower,
                        Int3 upper,
                        const Rigid& probe_from_volume,
                        double shift_mm) const noexcept {
    const Point3 centre = grid.point_from_voxel(
        {0.5 * (lower.x + upper.x), 0.5 * (lower.y + upper.y), 0.5 * (lower.z + upper.z)});
    const double half_mm = 0.5 * (upper.x - lower.x + 1) * grid.spacing_mm.x;
    const Matrix3& turn = probe_from_volume.rotation;
    const double across = std::abs(turn(1, 0)) + std::abs(turn(1, 1)) + std::abs(turn(1, 2));
    return reaches(probe_from_volume * centre, std::sqrt(3.0) * half_mm + shift_mm,
                   across * half_mm + shift_mm);
}

}  // namespace sonocase::runtime
