// SPDX-License-Identifier: Apache-2.0

// The point of a set that is nearest to a query, from a hash of cubic cells. Internal to
// formats/calibration; pipeline/registration uses a k-d tree of nanoflann, which the player does
// not link.
#pragma once

#include <cstdint>
#include <span>
#include <unordered_map>
#include <vector>

#include "formats/base/geometry.h"

namespace sonocase::calibrate {

// Searches growing shells of cells round the query until no nearer point can be left. The points
// must outlive the index. Cost of a query: constant where cell_mm is about the distance between
// neighbours; far from all points it grows with the shells up to the points' bounding box.
class NearestPoint {
  public:
    NearestPoint(std::span<const Point3> points, double cell_mm);
    // Index of the nearest point; 0 if there are none.
    std::size_t operator()(Point3 p) const;

  private:
    Int3 cell_of(Point3 p) const;
    static std::uint64_t key(Int3 cell);

    std::span<const Point3> points_;
    double cell_mm_;
    Box3 box_;
    std::unordered_map<std::uint64_t, std::vector<std::uint32_t>> cells_;
};

}  // namespace sonocase::calibrate
