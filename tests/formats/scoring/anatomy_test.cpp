// SPDX-License-Identifier: Apache-2.0

#include "formats/scoring/anatomy.h"

#include <gtest/gtest.h>

#include "formats/scoring/session_score.h"
#include "formats/volume/boundary_record.h"
#include "support/random.h"

namespace sonocase {
namespace {

// A cube of edge 2 about the origin, twelve triangles.
Surface cube() {
    Surface s;
    for (int i = 0; i < 8; ++i)
        s.points.push_back({i & 1 ? 1.0 : -1.0, i & 2 ? 1.0 : -1.0, i & 4 ? 1.0 : -1.0});
    s.triangles = {{0, 2, 1}, {1, 2, 3}, {4, 5, 6}, {5, 7, 6}, {0, 1, 4}, {1, 5, 4},
                   {2, 6, 3}, {3, 6, 7}, {0, 4, 2}, {2, 4, 6}, {1, 3, 5}, {3, 7, 5}};
    return s;
}

TEST(MeshAnatomy, KnowsTheInsideOfACubeAlsoOnItsDiagonals) {
    const MeshAnatomy body(cube());
    testing::Random random(4);
    for (int i = 0; i < 20000; ++i) {
        const Point3 p = random.point(1.5);
        const bool in = std::abs(p.x) < 1 && std::abs(p.y) < 1 && std::abs(p.z) < 1;
        ASSERT_EQ(body.inside(p), in) << p.x << " " << p.y << " " << p.z;
    }
    // Lines through edges and vertices of the faces above.
    for (const double x : {-0.5, 0.0, 0.5}) {
        EXPECT_TRUE(body.inside({x, x, 0}));
        EXPECT_TRUE(body.inside({x, -x, 0}));
        EXPECT_FALSE(body.inside({x, -x, -2}));
    }
    EXPECT_NEAR(body.exit_distance({0.2, 0.1, -0.5}, {0, 0, 1}, 100), 1.5, 1e-12);
    EXPECT_EQ(body.exit_distance({0.2, 0.1, -0.5}, {0, 0, 1}, 1), 1);
}

TEST(MeshAnatomy, AnEmptyMeshHasNoInside) {
    const MeshAnatomy body{Surface{}};
    EXPECT_FALSE(body.inside({0, 0, 0}));
}

// A half space z < 10.3 in voxels of 1 mm with exact boundary planes.
CaseBundle half_space(bool with_boundary) {
    CaseBundle b;
    b.grid = {{20, 20, 40}, {1, 1, 1}, {-10, -10, -20}, {}};
    b.labels = {{"outside", "outside", 0, {}}, {"body", "soft", 1, {}}};
    std::vector<std::uint8_t> labels;
    std::vector<std::uint32_t> boundary;
    for (int k = 0; k < 40; ++k) {
        for (int i = 0; i < 400; ++i) {
            const double z = k - 20;
            const bool in = z < 10.3;
            labels.push_back(in ? 1 : 0);
            const double d = in ? 10.3 - z : z - 10.3;
            boundary.push_back(
                d > 2 ? kNoBoundary
                      : pack_boundary(
                            {static_cast<std::uint8_t>(in ? 0 : 1), d, {0, 0, in ? -1.0 : 1.0}}));
        }
    }
    b.label_bricks = bricks_from_dense<std::uint8_t>(labels, b.grid.size);
    if (with_boundary) b.boundary = bricks_from_dense<std::uint32_t>(boundary, b.grid.size);
    return b;
}

TEST(CaseAnatomy, FollowsTheBoundaryPlaneInsideTheVoxel) {
    const CaseBundle fine = half_space(true), coarse = half_space(false);
    const CaseAnatomy with(fine), without(coarse);
    // The record keeps the distance to 1/96 voxel and the normal to a degree.
    for (double z = 9; z < 12; z += 0.01) {
        if (std::abs(z - 10.3) < 0.02) continue;
        EXPECT_EQ(with.inside({0.2, 0.4, z}), z < 10.3) << z;
    }
    EXPECT_TRUE(without.inside({0, 0, 10.45}));  // the voxel centred on 10 is body to its face
    EXPECT_NEAR(with.exit_distance({0, 0, 0}, {0, 0, 1}, 100), 10.3, 0.02);
    EXPECT_EQ(with.exit_distance({0, 0, 0}, {0, 0, 1}, 4), 4);
    EXPECT_NEAR(insertion_depth_mm(with, {0, 0, 4.3}, {0, 0, -1}, 150), 6, 0.02);
    EXPECT_LE(insertion_depth_mm(with, {0, 0, 14}, {0, 0, -1}, 150), -3.5);
}

// A block of liver in the middle of a body.
CaseBundle block_of_liver() {
    CaseBundle b;
    b.grid = {{96, 96, 96}, {1, 1, 1}, {-48, -48, -48}, {}};
    b.labels = {{"outside", "outside", 0, {}}, {"muscle", "soft", 1, {}}, {"liver", "soft", 1, {}}};
    std::vector<std::uint8_t> labels;
    for (int k = 0; k < 96; ++k) {
        for (int j = 0; j < 96; ++j) {
            for (int i = 0; i < 96; ++i) {
                const int out = std::max({std::abs(i - 48), std::abs(j - 48), std::abs(k - 48)});
                labels.push_back(out > 45 ? 0 : out > 24 ? 1 : 2);
            }
        }
    }
    b.label_bricks = bricks_from_dense<std::uint8_t>(labels, b.grid.size);
    return b;
}

TEST(CaseAnatomy, BreathingMovesOrgansAndComesBack) {
    const CaseBundle b = block_of_liver();
    const CaseAnatomy still(b), breathing(b, {.amplitude_mm = 4, .period_s = 4});
    EXPECT_EQ(breathing.greatest_shift_mm(), 4);
    testing::Random random(11);
    for (int i = 0; i < 2000; ++i) {
        const Point3 p = random.point(47);
        const double t = random.uniform(0, 20);
        EXPECT_EQ(still.moved(p, t), p);
        EXPECT_EQ(still.at_rest(p, t), p);
        // moved() stops at steps of 1e-9 mm; each step is at most half the one before.
        EXPECT_LT(distance(breathing.at_rest(breathing.moved(p, t), t), p), 1e-8);
        EXPECT_LE(distance(breathing.moved(p, t), p), 4 + 1e-9);
        EXPECT_EQ(breathing.moved(p, 4), p);              // the end of expiration
        EXPECT_EQ(breathing.inside(p), still.inside(p));  // the mannequin's skin stays
    }
    // In the middle of the liver the weight is 1: the whole amplitude, towards -y.
    EXPECT_LT(distance(breathing.moved({0, 0, 0}, 2), {0, -4, 0}), 1e-6);
    EXPECT_LT(distance(breathing.moved({46, 0, 0}, 2), {46, 0, 0}), 0.1);
    // What stands above the liver's edge at rest is muscle, and liver when the liver comes there.
    EXPECT_EQ(breathing.label(breathing.at_rest({0, -25, 0}, 0)), 1);
    EXPECT_EQ(breathing.label(breathing.at_rest({0, -25, 0}, 2)), 2);
}

TEST(CaseAnatomy, BeyondTheVolumeIsOutside) {
    const CaseBundle b = half_space(true);
    const CaseAnatomy body(b);
    EXPECT_FALSE(body.inside({100, 0, 0}));
    EXPECT_FALSE(body.inside({NAN, 0, 0}));
    EXPECT_FALSE(body.inside({0, -INFINITY, 0}));
    EXPECT_TRUE(body.inside({-10.4, 0, 0}));
    EXPECT_FALSE(body.inside({-10.6, 0, 0}));
}

}  // namespace
}  // namespace sonocase
