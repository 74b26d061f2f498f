// SPDX-License-Identifier: Apache-2.0

// The distance to a union of labels on parts of its box against that on the whole box.
#include "pipeline/segmentation/distance/label_distance.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "support/random.h"
#include "support/shapes.h"

namespace sonocase::pipeline {
namespace {

using sonocase::testing::cubic_grid;
using sonocase::testing::Random;
using sonocase::testing::sample_labels;

// Balls, a thin plate, rods of one and two voxels at all angles, and crumbs: something for every
// width of smoothing.
LabelVolume clutter(Vector3 spacing_mm, Int3 size) {
    Grid grid = cubic_grid(8);
    grid.size = size;
    grid.spacing_mm = spacing_mm;
    const std::uint64_t seed = 26;
    SCOPED_TRACE(seed);
    Random random(seed);
    const Point3 low = grid.origin_mm,
                 high = grid.point_from_voxel({size.x - 1.0, size.y - 1.0, size.z - 1.0});
    const auto anywhere = [&] {
        return Point3{random.uniform(low.x, high.x), random.uniform(low.y, high.y),
                      random.uniform(low.z, high.z)};
    };
    struct Shape {
        Point3 at;
        Vector3 along;
        double radius, reach;
    };
    std::vector<Shape> shapes;
    for (int n = 0; n < 60; ++n) {
        const Vector3 along = normalized(anywhere() - anywhere());
        const bool rod = n % 3 != 0;
        shapes.push_back({anywhere(), along, rod ? random.uniform(0.5, 1.3) : random.uniform(2, 11),
                          rod ? random.uniform(5, 60) : 0});
    }
    return sample_labels(grid, 3, [&](Point3 p) {
        if (std::abs(p.x - low.x - 30) < 0.6) return 2;
        for (const Shape& s : shapes) {
            const Vector3 d = p - s.at;
            const double t = std::clamp(dot(d, s.along), -s.reach, s.reach);
            if (norm(d - t * s.along) < s.radius) return 1;
        }
        return 0;
    });
}

// Cuts the box into parts and compares each with the whole, bit by bit. Returns the share of the
// nodes that differ.
double compare_parts(const LabelVolume& volume, const LabelSet& labels, Int3 edge) {
    const LabelDistance distance(volume, {});
    LabelDistance::Scratch scratch;
    SparseBox sparse;
    std::vector<float> whole, piece;
    const VoxelBox box = distance.distance(labels, &whole, &scratch);
    EXPECT_EQ(whole.size(), box.count());
    std::size_t compared = 0, differ = 0;
    float largest = 0;
    for (int z = 0; z < box.size.z; z += edge.z) {
        for (int y = 0; y < box.size.y; y += edge.y) {
            for (int x = 0; x < box.size.x; x += edge.x) {
                const VoxelBox part{
                    {box.first.x + x, box.first.y + y, box.first.z + z},
                    {std::min(edge.x, box.size.x - x), std::min(edge.y, box.size.y - y),
                     std::min(edge.z, box.size.z - z)}};
                distance.distance_on(labels, part, nullptr, &sparse, &scratch);
                to_plain(sparse, &piece);
                EXPECT_EQ(piece.size(), part.count());
                std::size_t n = 0;
                for (int k = 0; k < part.size.z; ++k) {
                    for (int j = 0; j < part.size.y; ++j) {
                        for (int i = 0; i < part.size.x; ++i, ++n) {
                            const float other = whole[box.index(x + i, y + j, z + k)];
                            ++compared;
                            differ += piece[n] != other;
                            largest = std::max(largest, std::abs(piece[n] - other));
                        }
                    }
                }
            }
        }
    }
    EXPECT_EQ(compared, box.count());
    // One stray voxel more or less slightly changes the width of smoothing around it.
    EXPECT_LT(largest, 0.3 * volume.grid.spacing_mm.x);
    return static_cast<double>(differ) / static_cast<double>(compared);
}

TEST(LabelDistance, PartsAreTheWholeCutUp) {
    const LabelVolume volume = clutter({0.8, 0.8, 0.8}, {110, 96, 100});
    LabelSet both = one_label(1);
    both.set(2);
    EXPECT_LT(compare_parts(volume, one_label(1), {37, 40, 33}), 2e-3);
    EXPECT_LT(compare_parts(volume, both, {64, 64, 64}), 2e-3);
    EXPECT_EQ(compare_parts(volume, one_label(0), {1000, 1000, 1000}), 0);
}

TEST(LabelDistance, ColumnsOfThickSlicesAreTheWholeCutUp) {
    const LabelVolume volume = clutter({1, 1, 4}, {120, 110, 14});
    EXPECT_LT(compare_parts(volume, one_label(1), {48, 40, 1000}), 2e-3);
}

TEST(LabelDistance, SmoothStructuresAreTheSameToTheLastBit) {
    // A ball has no stray voxels, so nothing depends on where a part ends.
    Grid grid = cubic_grid(120);
    const LabelVolume volume = sample_labels(grid, 2, [](Point3 p) {
        return norm(p - Point3{3, 1, -2}) < 38 ? 1 : 0;
    });
    EXPECT_EQ(compare_parts(volume, one_label(1), {30, 40, 50}), 0);
}

}  // namespace
}  // namespace sonocase::pipeline
