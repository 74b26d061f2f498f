// SPDX-License-Identifier: Apache-2.0

#include "formats/calibration/nearest_point.h"

#include <algorithm>
#include <cmath>

namespace sonocase::calibrate {
namespace {

double square(double a) {
    return a * a;
}

}  // namespace

NearestPoint::NearestPoint(std::span<const Point3> points, double cell_mm)
    : points_(points), cell_mm_(cell_mm) {
    for (const Point3& p : points) box_.include(p);
    for (std::size_t i = 0; i < points.size(); ++i) {
        cells_[key(cell_of(points[i]))].push_back(static_cast<std::uint32_t>(i));
    }
}

std::size_t NearestPoint::operator()(Point3 p) const {
    const Int3 at = cell_of(p);
    std::size_t best = 0;
    double best_square = INFINITY;
    // Shells beyond the farthest cell of the box are empty.
    const Int3 low = cell_of(box_.lower), high = cell_of(box_.upper);
    int last = 0, first = 0;
    for (int c = 0; c < 3; ++c) {
        last = std::max({last, std::abs(at[c] - low[c]), std::abs(at[c] - high[c])});
        first = std::max({first, low[c] - at[c], at[c] - high[c]});
    }
    for (int shell = first; shell <= last; ++shell) {
        if (shell > 0 && best_square <= square((shell - 1) * cell_mm_)) break;
        for (int dz = -shell; dz <= shell; ++dz) {
            for (int dy = -shell; dy <= shell; ++dy) {
                const bool face = std::abs(dz) == shell || std::abs(dy) == shell;
                for (int dx = -shell; dx <= shell; dx += face ? 1 : std::max(1, 2 * shell)) {
                    const auto cell = cells_.find(key({at.x + dx, at.y + dy, at.z + dz}));
                    if (cell == cells_.end()) continue;
                    for (std::uint32_t i : cell->second) {
                        const Vector3 v = points_[i] - p;
                        if (dot(v, v) < best_square) {
                            best_square = dot(v, v);
                            best = i;
                        }
                    }
                }
            }
        }
    }
    return best;
}

Int3 NearestPoint::cell_of(Point3 p) const {
    const auto cell = [this](double v, double low) {
        return static_cast<std::int32_t>(std::clamp(std::floor((v - low) / cell_mm_), -1e6, 1e6));
    };
    return {cell(p.x, box_.lower.x), cell(p.y, box_.lower.y), cell(p.z, box_.lower.z)};
}

std::uint64_t NearestPoint::key(Int3 cell) {
    const auto part = [](std::int32_t v) {
        return static_cast<std::uint64_t>(v + 1048576) & 0x1fffff;
    };
    return part(cell.x) | part(cell.y) << 21 | part(cell.z) << 42;
}

}  // namespace sonocase::calibrate
