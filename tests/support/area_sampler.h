// SPDX-License-Identifier: Apache-2.0

// Points spread evenly over the area of a triangle mesh.
#pragma once

#include <algorithm>
#include <cstdint>
#include <vector>

#include "formats/volume/surface.h"
#include "support/random.h"

namespace sonocase::testing {

struct AreaSample {
    Point3 point;
    Vector3 normal;            // of the triangle, not of unit length
    std::uint32_t corner = 0;  // one point of the triangle
};

class AreaSampler {
  public:
    // surface: is kept by reference.
    explicit AreaSampler(const Surface& surface) : surface_(surface) {
        for (const auto& t : surface.triangles) {
            const Vector3 n = cross(surface.points[t[1]] - surface.points[t[0]],
                                    surface.points[t[2]] - surface.points[t[0]]);
            area_.push_back(area_.back() + 0.5 * norm(n));
        }
    }

    AreaSample draw(Random& random) const {
        const double at = random.uniform(0, area_.back());
        const auto above = std::upper_bound(area_.begin() + 1, area_.end() - 1, at);
        const auto& t = surface_.triangles[static_cast<std::size_t>(above - area_.begin() - 1)];
        double u = random.uniform(0, 1), v = random.uniform(0, 1);
        if (u + v > 1) {
            u = 1 - u;
            v = 1 - v;
        }
        const Point3 a = surface_.points[t[0]];
        const Vector3 ab = surface_.points[t[1]] - a, ac = surface_.points[t[2]] - a;
        return {a + (u * ab + v * ac), cross(ab, ac), t[0]};
    }

  private:
    const Surface& surface_;
    std::vector<double> area_{0};
};

}  // namespace sonocase::testing
