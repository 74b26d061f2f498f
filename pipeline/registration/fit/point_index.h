// SPDX-License-Identifier: Apache-2.0

// Nearest neighbours in a set of points: a k-d tree over a copy of them (nanoflann).
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "formats/base/geometry.h"

namespace sonocase::pipeline::inline registration_fit {

class PointIndex {
  public:
    static constexpr std::uint32_t kNone = UINT32_MAX;

    PointIndex();
    explicit PointIndex(std::span<const Point3> points);  // finite
    ~PointIndex();
    PointIndex(PointIndex&&) noexcept;
    PointIndex& operator=(PointIndex&&) noexcept;

    bool empty() const;
    // Index of the point nearest to p; the set must not be empty. Ties are broken arbitrarily.
    std::uint32_t nearest(Point3 p, double* squared_distance = nullptr) const;
    // The same, but kNone if no point is nearer than the root of within2. guess, an index or kNone:
    // a point that is likely to be the nearest, or near it; the search then looks at little else.
    std::uint32_t nearest_within(Point3 p,
                                 double within2,
                                 std::uint32_t guess,
                                 double* squared_distance = nullptr) const;
    // The `count` nearest (fewer if there are fewer), nearest first.
    std::vector<std::uint32_t> nearest(Point3 p, int count) const;

  private:
    struct Impl;
    std::unique_ptr<Impl> impl_;
};

}  // namespace sonocase::pipeline::inline registration_fit
