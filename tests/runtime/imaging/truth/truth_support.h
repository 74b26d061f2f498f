// SPDX-License-Identifier: Apache-2.0

// What the tests of the truth share.
#pragma once

#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <vector>

#include "../imaging_support.h"
#include "formats/scoring/anatomy.h"
#include "runtime/imaging/truth/frame_truth.h"

namespace sonocase::runtime {

struct Planes {
    explicit Planes(const RenderOptions& o)
        : width(o.width_px),
          labels(static_cast<std::size_t>(o.width_px) * o.height_px, 77),
          needle(labels.size(), 77),
          shadowed(labels.size(), 77),
          lesions(labels.size(), 77),
          depth(labels.size(), -77.0f),
          rest(labels.size(), {-77.0f, -77.0f, -77.0f}) {}
    TruthPlanes spans() { return {labels, needle, shadowed, depth, lesions, rest}; }
    std::size_t at(int column, int row) const {
        return static_cast<std::size_t>(row) * width + static_cast<std::size_t>(column);
    }
    bool operator==(const Planes& o) const {
        // Bit by bit: NaN equals itself.
        return labels == o.labels && needle == o.needle && shadowed == o.shadowed &&
               lesions == o.lesions &&
               std::memcmp(depth.data(), o.depth.data(), 4 * depth.size()) == 0 &&
               std::memcmp(rest.data(), o.rest.data(), 12 * rest.size()) == 0;
    }
    int width;
    std::vector<std::uint8_t> labels, needle, shadowed, lesions;
    std::vector<float> depth;
    std::vector<std::array<float, 3>> rest;
};

inline TruthRenderer truth_of(CaseView bundle,
                              const Exercise& exercise,
                              const RenderOptions& options) {
    auto truth = TruthRenderer::create(bundle, exercise, options);
    EXPECT_TRUE(truth) << truth.error().message();
    return std::move(*truth);
}

inline RenderOptions picture(int width, int height, std::vector<std::string> effects = {"auto"}) {
    RenderOptions options;
    options.width_px = width;
    options.height_px = height;
    options.effects = std::move(effects);
    return options;
}

// Depth along its beam of a point of the plane; negative: outside the scanned area.
inline double depth_along(const Probe& probe, double x, double z) {
    if (probe.shape == ProbeShape::linear)
        return std::abs(x) <= 0.5 * probe.width_mm && z >= 0 && z <= probe.depth_mm ? z : -1;
    const double radius = probe.shape == ProbeShape::phased ? 0 : probe.radius_mm;
    const double r = std::hypot(x, z + radius) - radius;
    const bool in = std::abs(std::atan2(x, z + radius)) <= 0.5 * probe.field_of_view_rad;
    return in && r >= 0 && r <= probe.depth_mm ? r : -1;
}

}  // namespace sonocase::runtime
