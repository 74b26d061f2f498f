// SPDX-License-Identifier: Apache-2.0

// Ground truth for registration: a skin moved by a known map, and readings of it.
#pragma once

#include <algorithm>
#include <vector>

#include "formats/volume/surface.h"
#include "pipeline/registration/map/registration.h"
#include "support/area_sampler.h"
#include "support/random.h"

namespace sonocase::testing {

// A random pose and a random quadratic about the box's middle that moves the skin by mean_mm on
// average.
inline Registration random_quadratic_map(const Box3& box,
                                         const Surface& skin,
                                         Random& random,
                                         double mean_mm) {
    Registration map;
    map.ct_box = box;
    map.mannequin_from_ct = random.rigid(300);
    QuadraticMap bend;
    bend.centre_mm = box.centre();
    bend.scale_mm = 150;
    for (auto& row : bend.coefficients) {
        row[0] = 0;
        for (std::size_t c = 1; c < 10; ++c) row[c] = random.gaussian() * (c < 4 ? 1 : 0.7);
    }
    // No rotation of the whole: the pose contains that.
    for (std::size_t a = 0; a < 3; ++a) {
        for (std::size_t b = 0; b < a; ++b) {
            const double mean = 0.5 * (bend.coefficients[a][b + 1] + bend.coefficients[b][a + 1]);
            bend.coefficients[a][b + 1] = bend.coefficients[b][a + 1] = mean;
        }
    }
    double moved = 0;
    for (Point3 p : skin.points) moved += norm(map_point(bend, p) - Point3{});
    const double scale = mean_mm * static_cast<double>(skin.points.size()) / moved;
    map.quadratic = QuadraticMap::from_rigid(map.mannequin_from_ct, bend.centre_mm, 150);
    for (int r = 0; r < 3; ++r) {
        for (std::size_t c = 1; c < 10; ++c) {
            for (int a = 0; a < 3; ++a) {
                map.quadratic.coefficients[static_cast<std::size_t>(r)][c] +=
                    scale * map.mannequin_from_ct.rotation(r, a) *
                    bend.coefficients[static_cast<std::size_t>(a)][c];
            }
        }
    }
    return map;
}

enum class SweptPart { all, front, one_side };

struct SweepPlan {
    int points = 2000;
    double noise_mm = 0.7;  // per axis
    SweptPart part = SweptPart::all;
    double lift_off_share = 0;  // of readings 10 to 60 mm off the skin
};

// Readings spread evenly over the skin's area and moved by the map.
inline Surface sweep_of(const Surface& skin,
                        const Registration& map,
                        Random& random,
                        const SweepPlan& plan = {}) {
    const AreaSampler sampler(skin);
    std::vector<double> depth, side;
    for (Point3 p : skin.points) {
        depth.push_back(p.y);
        side.push_back(p.x);
    }
    const auto median = [](std::vector<double>& v) {
        std::nth_element(v.begin(), v.begin() + static_cast<std::ptrdiff_t>(v.size() / 2), v.end());
        return v[v.size() / 2];
    };
    const double middle_depth = median(depth), middle_side = median(side);
    Surface readings;
    while (static_cast<int>(readings.points.size()) < plan.points) {
        const auto [p, facing, corner] = sampler.draw(random);
        if (plan.part == SweptPart::front && p.y < middle_depth) continue;
        if (plan.part == SweptPart::one_side && p.x < middle_side) continue;
        const Vector3 noise{random.gaussian(), random.gaussian(), random.gaussian()};
        Point3 y = mannequin_from_ct(map, p) + plan.noise_mm * noise;
        if (random.uniform(0, 1) < plan.lift_off_share) {
            const Vector3 n = transpose(inverse(jacobian(map, p))) * skin.normals[corner];
            y = y + random.uniform(10, 60) * normalized(n);
        }
        readings.points.push_back(y);
    }
    return readings;
}

}  // namespace sonocase::testing
