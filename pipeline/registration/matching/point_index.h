// SPDX-License-Identifier: Apache-2.0

// Nearest points among many: a kd-tree over a copy of the points.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "formats/base/geometry.h"

namespace sonocase::pipeline {

class PointIndex {
  public:
    PointIndex();
    explicit PointIndex(std::span<const Point3> points);  // finite
    ~PointIndex();
    PointIndex(PointIndex&&) noexcept;
    PointIndex& operator=(PointIndex&&) noexcept;

    bool empty() const;
    // Number of the point nearest to p; the index must not be empty. Ties go to either.
    std::uint32_t nearest(Point3 p, double* squared_distance = nullptr) const;
    // The `count` nearest (fewer if there are fewer), nearest first.
    std::vector<std::uint32_t> nearest(Point3 p, int count) const;

  private:
    struct Impl;
    std::unique_ptr<Impl> impl_;
};

}  // namespace sonocase::pipeline
