// SPDX-License-Identifier: Apache-2.0

#include "pipeline/pathology/lesion_shape.h"

#include <gtest/gtest.h>

#include "support/hard_case.h"
#include "support/shapes.h"

namespace sonocase::pipeline {
namespace {

using testing::cubic_grid;
using testing::HardCase;
using testing::sample_labels;

TEST(RoughEllipsoid, WithoutRoughnessOrElongationIsABall) {
    const RoughEllipsoid ball(1, 0, 1, 5);
    for (const Vector3 u : sphere_directions(50)) EXPECT_NEAR(ball.radius(u), 1, 1e-12);
}

TEST(RoughEllipsoid, HasTheRoughnessAskedForAndIsTheSameForTheSameSeed) {
    const RoughEllipsoid a(1, 0.2, 1, 9), b(1, 0.2, 1, 9), c(1, 0.2, 1, 10);
    double square = 0, other = 0;
    const auto directions = sphere_directions(1000);
    for (const Vector3 u : directions) {
        square += (a.radius(u) - 1) * (a.radius(u) - 1);
        EXPECT_EQ(a.radius(u), b.radius(u));
        other += std::abs(a.radius(u) - c.radius(u));
    }
    EXPECT_NEAR(std::sqrt(square / 1000), 0.2, 0.02);  // clipped at 0.3 of the radius
    EXPECT_GT(other, 10);
}

TEST(RoughEllipsoid, AnAlignedOneIsAsLongAsItsAspect) {
    RoughEllipsoid oval(1, 0, 2, 1);
    oval.align({0, 0, 1});
    EXPECT_NEAR(oval.radius({0, 0, 1}) / oval.radius({1, 0, 0}), 2, 1e-9);
}

// A block of label 1 with a rod of label 2 beside the lesion; the rod must be moved as a whole.
TEST(MassEffect, MovesARodAndKeepsItsVolume) {
    const LabelVolume before = sample_labels(
        cubic_grid(81), 3, [](Point3 p) { return std::hypot(p.x - 14, p.y) < 3 ? 2 : 1; });
    const BoundaryBricks no_boundary;
    LabelCanvas canvas(before, no_boundary);
    const RoughEllipsoid shape(1, 0, 1, 1);
    const Vector3 centre{40, 40, 40};
    const double smallest =
        push_aside(canvas, {centre, shape.rank_about(centre), 12, 0.8, 2.5, {}});
    HardCase folding("det J of a mass that pushes a rod aside", HardCase::at_least, 0.05, "");
    folding.see(smallest);
    const auto was = static_cast<double>(testing::count_label(before, 2));
    const auto is = static_cast<double>(testing::count_label(canvas.volume(), 2));
    // It lies where the tissue is pressed most.
    HardCase volume("volume of the rod, off", HardCase::at_most, 0.1, "");
    volume.see(std::abs(is / was - 1));
    // In the middle the rod has been pushed outwards, at the ends it is where it was.
    EXPECT_EQ(canvas.label({54, 40, 2}), 2);
    EXPECT_EQ(canvas.label({52, 40, 40}), 1);
}

TEST(MassEffect, WhatIsFixedStays) {
    const LabelVolume before =
        sample_labels(cubic_grid(41), 3, [](Point3 p) { return p.x > 8 ? 2 : 1; });
    const BoundaryBricks no_boundary;
    LabelCanvas canvas(before, no_boundary);
    const RoughEllipsoid shape(1, 0, 1, 1);
    const Vector3 centre{20, 20, 20};
    push_aside(canvas, {centre, shape.rank_about(centre), 7, 1, 2.5, LabelSet{}.set(2)});
    EXPECT_EQ(canvas.volume().voxels, before.voxels);
}

TEST(LabelCanvas, PaintsABallWithRecordsOnBothSides) {
    const LabelVolume before = sample_labels(cubic_grid(33), 2, [](Point3) { return 1; });
    const std::vector<std::uint32_t> none(before.voxels.size(), kNoBoundary);
    const BoundaryBricks no_boundary = bricks_from_dense<std::uint32_t>(none, before.grid.size);
    LabelCanvas canvas(before, no_boundary);
    const std::uint8_t label = canvas.add_label({"ball", "lesion", 0, {}});
    const Vector3 centre{16.3, 15.9, 16.1};
    canvas.paint(
        canvas.everything(), [&](Vector3 at) { return norm(at - centre) - 8.0; }, label,
        LabelSet{}.set(1));
    const BoundaryBricks boundary = canvas.take_boundary();
    const LabelVolume volume = canvas.take_volume();
    int records = 0;
    for (int k = 0; k < 33; ++k)
        for (int j = 0; j < 33; ++j)
            for (int i = 0; i < 33; ++i) {
                const double d = norm(Vector3{1.0 * i, 1.0 * j, 1.0 * k} - centre) - 8;
                const bool inside = volume.voxels[volume.grid.index(i, j, k)] == label;
                EXPECT_EQ(inside, d < 0);
                const std::uint32_t packed = boundary.at(i, j, k);
                EXPECT_TRUE(std::abs(d) <= 1.55 || packed == kNoBoundary);
                if (packed == kNoBoundary) continue;
                ++records;
                const BoundaryRecord r = unpack_boundary(packed);
                EXPECT_EQ(r.second_label, inside ? 1 : label);
                EXPECT_NEAR(r.distance_vx, std::abs(d), 0.02);  // packing: a hundredth
            }
    EXPECT_GT(records, 1500);
}

}  // namespace
}  // namespace sonocase::pipeline
