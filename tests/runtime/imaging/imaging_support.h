// SPDX-License-Identifier: Apache-2.0

// What the tests of the image models share.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numeric>
#include <vector>

#include "runtime/imaging/renderer.h"
#include "runtime/workers/thread_host.h"
#include "support/phantom_bundle.h"
#include "support/picture.h"

namespace sonocase::runtime {

using sonocase::testing::Phantom;
using sonocase::testing::phantom_exercise;
using sonocase::testing::Random;

inline const CaseBundle& phantom() {
    static const CaseBundle bundle = Phantom().bundle();
    return bundle;
}

// The fan of the sweep over a real liver from which the limits of realism come (docs/realism.md).
inline Exercise sweep_exercise() {
    Exercise e = phantom_exercise();
    e.probe.radius_mm = 50.6;
    e.probe.field_of_view_rad = 60.2 * kRadPerDeg;
    e.probe.depth_mm = 180;
    e.probe.frequency_mhz = 3.5;
    e.probe.focus_mm = 90;
    e.probe.elevation_mm = 3;
    return e;
}

// Liver alone between two corners.
inline CaseBundle liver_alone(Point3 lower, Point3 upper, double voxel_mm) {
    sonocase::testing::PhantomOptions o;
    o.ribs = o.gas = o.vessels = o.kidney = o.layers = false;
    o.lower = lower;
    o.upper = upper;
    o.voxel_mm = voxel_mm;
    return Phantom(o).bundle();
}

inline FrameInput needle_input() {
    FrameInput input;
    input.has_needle = true;
    input.needle.tip = {10, 0.3, 60};
    input.needle.direction = normalized({0.6, 0.004, 0.8});
    return input;
}

inline std::vector<std::uint8_t> draw(const Exercise& exercise,
                                      const RenderOptions& options,
                                      const FrameInput& input,
                                      const CaseBundle& bundle = phantom()) {
    auto renderer = Renderer::create(bundle, exercise, options);
    EXPECT_TRUE(renderer.has_value());
    std::vector<std::uint8_t> pixels(static_cast<std::size_t>(options.width_px) * options.height_px,
                                     77);
    EXPECT_EQ(renderer->render(input, pixels), FrameStatus::rendered);
    return pixels;
}

struct Difference {
    double mean = 0, bias = 0;
    int worst = 0;
};

inline Difference compare(const std::vector<std::uint8_t>& a, const std::vector<std::uint8_t>& b) {
    Difference d;
    for (std::size_t i = 0; i < a.size(); ++i) {
        const int e = int(a[i]) - int(b[i]);
        d.mean += std::abs(e);
        d.bias += e;
        d.worst = std::max(d.worst, std::abs(e));
    }
    d.mean /= static_cast<double>(a.size());
    d.bias /= static_cast<double>(a.size());
    return d;
}

inline Rigid random_pose(Random& random) {
    const Matrix3 turn = rotation_about({0, 0, 1}, random.uniform(-3.1, 3.1)) *
                         rotation_about(random.direction(), random.uniform(0, 0.4));
    return {turn, {random.uniform(-20, 20), random.uniform(-10, 10), random.uniform(-4, 4)}};
}

// A random pose with a needle near its plane.
inline FrameInput random_input(Random& random, std::uint32_t frame) {
    FrameInput input = needle_input();
    input.mannequin_from_probe = random_pose(random);
    input.needle.tip =
        input.mannequin_from_probe *
        Point3{random.uniform(-20, 20), random.uniform(-1, 1), random.uniform(20, 90)};
    input.needle.direction = random.direction();
    input.frame = frame;
    return input;
}

// Of two series of the same length, in [-1, 1].
inline double correlation(const std::vector<double>& a, const std::vector<double>& b) {
    const auto n = static_cast<double>(a.size());
    const double ma = std::accumulate(a.begin(), a.end(), 0.0) / n,
                 mb = std::accumulate(b.begin(), b.end(), 0.0) / n;
    double aa = 0, bb = 0, ab = 0;
    for (std::size_t i = 0; i < a.size(); ++i) {
        aa += (a[i] - ma) * (a[i] - ma);
        bb += (b[i] - mb) * (b[i] - mb);
        ab += (a[i] - ma) * (b[i] - mb);
    }
    return ab / std::sqrt(aa * bb);
}

}  // namespace sonocase::runtime
