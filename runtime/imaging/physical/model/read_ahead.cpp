// SPDX-License-Identifier: Apache-2.0

#include "runtime/imaging/physical/model/read_ahead.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace sonocase::runtime {
namespace {

constexpr double kDeviations = 4;  // limit of the random step: its noise is bytes of 1/32

// How far around the plane to read after what the frame reads, nearest first. The last is how far a
// probe comes in a third of a second when it slides at 100 mm/s, or turns at 40 degrees/s and shows
// 150 mm of depth.
constexpr double kAheadMm[] = {0, 8, 20, 35};

// A bundle that unpacks to more than this is read no further than the first step: all of it would
// end up in memory, and a frame needs little of it.
constexpr std::size_t kSmallBytes = std::size_t{200} << 20;

}  // namespace

ScanReach::ScanReach(const ScanGeometry& g, const physical::Tables& t, double voxel_mm)
    : fan_(g.fan), radius_mm_(g.radius_mm), half_extent_(g.half_extent) {
    // Where a gap to the skin closes, the tissue behind it moves up, the less the deeper it lies.
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

ReadAhead::ReadAhead(VoxelBlocks& blocks, const Grid& grid, std::unique_ptr<Background> background)
    : blocks_(blocks), grid_(grid), background_(std::move(background)) {
    background_->start([](void* self) { static_cast<ReadAhead*>(self)->read(); }, this);
}

ReadAhead::~ReadAhead() {
    stop_ = true;
    background_->stop();
}

void ReadAhead::frame(const ScanReach& reach,
                      const Rigid& volume_from_probe,
                      double shift_mm) noexcept {
    if (blocks_.whole()) return;
    frames_.publish({&reach, volume_from_probe, shift_mm});
    news_ = true;
    background_->wake();
}

void ReadAhead::read() noexcept {
    news_ = false;  // before the frame is taken, so that a later frame ends this call
    frames_.refresh();
    const Frame& frame = frames_.value();
    if (frame.reach == nullptr) return;
    for (const double ahead_mm : kAheadMm) {
        if (ahead_mm > kAheadMm[1] && blocks_.pool_bytes() > kSmallBytes) break;
        frame.reach->ensure_loaded_backwards(blocks_, grid_, frame.volume_from_probe,
                                             frame.shift_mm + ahead_mm,
                                             [this] { return news_ || stop_; });
    }
}

}  // namespace sonocase::runtime
