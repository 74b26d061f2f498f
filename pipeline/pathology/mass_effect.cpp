// SPDX-License-Identifier: Apache-2.0

#include <algorithm>
#include <cmath>
#include <vector>

#include "pipeline/pathology/lesion_shape.h"

namespace sonocase::pipeline {
namespace {

// Where a point of the pressed tissue comes from, as shares of the surface's radius.
struct RadialMap {
    double share, reach;

    double source(double q) const {
        const double s = (q - 1) / (reach - 1);
        if (s >= 1) return q;
        const double fade = s <= 0 ? 1 : (1 - s) * (1 - s) * (1 + 2 * s);
        return std::cbrt(std::max(0.0, q * q * q - share * fade));
    }
    double slope(double q) const {
        constexpr double kStep = 1e-4;
        return (source(q + kStep) - source(q)) / kStep;
    }
};

struct Found {
    std::uint8_t label = 0;
    std::uint32_t record = kNoBoundary;
};

// The labels around the lesion as they were before.
class Before {
  public:
    Before(const LabelCanvas& canvas, const VoxelRange& range) : canvas_(canvas), range_(range) {
        const Int3 low = range.low, high = range.high;
        size_ = {high.x - low.x + 1, high.y - low.y + 1, high.z - low.z + 1};
        voxels_.reserve(range.count());
        for (int k = low.z; k <= high.z; ++k)
            for (int j = low.y; j <= high.y; ++j)
                for (int i = low.x; i <= high.x; ++i)
                    voxels_.push_back({canvas.label({i, j, k}), canvas.record({i, j, k})});
    }

    const Found& at(Int3 v) const {
        const Int3 r{v.x - range_.low.x, v.y - range_.low.y, v.z - range_.low.z};
        return voxels_[static_cast<std::size_t>(r.x) +
                       static_cast<std::size_t>(size_.x) *
                           (static_cast<std::size_t>(r.y) +
                            static_cast<std::size_t>(size_.y) * static_cast<std::size_t>(r.z))];
    }

    // What lies at a point, with the surface near it as it looks after the map x(y), whose
    // derivative along `radial` is s_radial and across it s_across.
    Found moved(Vector3 x, Vector3 radial, double s_radial, double s_across) const {
        Int3 v;
        for (int axis = 0; axis < 3; ++axis)
            v[axis] = std::clamp(static_cast<int>(std::lround(x[axis])), range_.low[axis],
                                 range_.high[axis]);
        const Found& found = at(v);
        if (found.record == kNoBoundary) return found;
        const BoundaryRecord r = unpack_boundary(found.record);
        const Vector3 off{x.x - v.x, x.y - v.y, x.z - v.z};
        double d = r.distance_vx + dot(r.normal, off);
        const double along = dot(r.normal, radial);
        Vector3 n = s_across * (r.normal - along * radial) + (s_radial * along) * radial;
        const double length = norm(n);
        if (!(length > 1e-6)) return {found.label, kNoBoundary};
        d /= length;
        n = (1 / length) * n;
        if (std::abs(d) > LabelCanvas::kBandVx)
            return {d < 0 ? r.second_label : found.label, kNoBoundary};
        if (d < 0) return {r.second_label, pack_boundary({found.label, -d, -n})};
        return {found.label, pack_boundary({r.second_label, d, n})};
    }

  private:
    const LabelCanvas& canvas_;
    VoxelRange range_;
    Int3 size_;
    std::vector<Found> voxels_;
};

}  // namespace

double push_aside(LabelCanvas& canvas, const MassEffect& effect) {
    // Radii differ by direction by less than a factor of two on either side.
    double greatest = 0;
    for (const Vector3 u : sphere_directions(500)) {
        const double per_vx = effect.rank(effect.centre_vx + u);
        greatest = std::max(greatest, per_vx > 0 ? effect.threshold / per_vx : 0);
    }
    const VoxelRange range = canvas.around(effect.centre_vx, effect.reach * greatest + 1);
    if (range.empty() || effect.share <= 0) return 1;
    const Before before(canvas, range);
    const RadialMap map{effect.share, effect.reach};
    double least = 1;
    for (int k = range.low.z; k <= range.high.z; ++k)
        for (int j = range.low.y; j <= range.high.y; ++j)
            for (int i = range.low.x; i <= range.high.x; ++i) {
                const Vector3 y{static_cast<double>(i), static_cast<double>(j),
                                static_cast<double>(k)};
                const double q = effect.rank(y) / effect.threshold;
                if (!(q >= 1) || q >= effect.reach) continue;
                const double p = map.source(q), slope = map.slope(q);
                least = std::min(least, slope * p * p / (q * q));
                const Vector3 radial = normalized(y - effect.centre_vx);
                const Found& here = before.at({i, j, k});
                const Found there = before.moved(
                    effect.centre_vx + (p / q) * (y - effect.centre_vx), radial, slope, p / q);
                if (effect.fixed[here.label] || effect.fixed[there.label]) continue;
                canvas.set({i, j, k}, there.label, there.record);
            }
    return least;
}

}  // namespace sonocase::pipeline
