// SPDX-License-Identifier: Apache-2.0

#include <gtest/gtest.h>

#include "formats/base/constants.h"
#include "pipeline/base/counter_random.h"
#include "pipeline/import/mesh/mend_mesh.h"
#include "pipeline/import/mesh/mesh_shapes.h"
#include "pipeline/import/mesh/solid_voxels.h"
#include "support/hard_case.h"
#include "support/shapes.h"

namespace sonocase::pipeline {
namespace {

using testing::ball_mesh;
using testing::HardCase;
using testing::without_top;

Surface together(Surface a, const Surface& b) {
    const auto base = static_cast<std::uint32_t>(a.points.size());
    a.points.insert(a.points.end(), b.points.begin(), b.points.end());
    for (const auto& t : b.triangles)
        a.triangles.push_back({base + t[0], base + t[1], base + t[2]});
    return a;
}

TEST(MendMesh, WeldsPatchesAndTurnsThemOutwards) {
    // Every triangle has its own corners.
    const Surface ball = ball_mesh({3, 4, 5}, 20, 24, true);
    Surface soup;
    for (const auto& t : ball.triangles) {
        const auto n = static_cast<std::uint32_t>(soup.points.size());
        for (const std::uint32_t corner : t) soup.points.push_back(ball.points[corner]);
        soup.triangles.push_back({n, n + 1, n + 2});
    }
    MendReport report;
    mend_mesh(soup, {}, &report);
    EXPECT_EQ(report.components, 1);
    EXPECT_EQ(report.turned, 1);
    EXPECT_EQ(report.caps, 0);
    // Facets lie inside the ball.
    HardCase volume("volume of a ball of 34 ml from loose triangles, off", HardCase::at_most, 0.4,
                    "ml");
    volume.see(std::abs(report.volume_ml - 4.0 / 3 * kPi * 8));
}

TEST(MendMesh, CapsAnOpeningAndTellsItsLength) {
    MendReport report;
    const Surface bowl = without_top(ball_mesh({0, 0, 0}, 20, 40), 10);
    const Surface solid = mend_mesh(bowl, {}, &report);
    EXPECT_EQ(report.caps, 1);
    EXPECT_EQ(report.open_loops, 0);
    EXPECT_NEAR(report.longest_cap_mm, 2 * kPi * std::sqrt(300.0), 4);  // a ring of facets
    EXPECT_GT(solid.triangles.size(), bowl.triangles.size());
}

// A small part costs the same beside a large one as alone; a table cleared per part takes hours.
TEST(MendMesh, TakesNoLongerForEachOfManyParts) {
    Surface scan = ball_mesh({0, 0, 0}, 100, 300);
    const auto corners = static_cast<std::uint32_t>(scan.points.size());
    const int large = static_cast<int>(scan.triangles.size());
    constexpr std::uint32_t kParts = 100000;
    for (std::uint32_t n = 0; n < kParts; ++n) {
        const Point3 at{2.0 * (n % 50), 2.0 * (n / 50 % 50), 200 + 2.0 * (n / 2500)};
        const std::uint32_t first = corners + 3 * n;
        scan.points.insert(scan.points.end(), {at, at + Vector3{1, 0, 0}, at + Vector3{0, 1, 0}});
        scan.triangles.push_back({first, first + 1, first + 2});
    }
    MendReport report;
    const Surface solid = mend_mesh(scan, {}, &report);
    EXPECT_EQ(report.components, static_cast<int>(kParts) + 1);
    EXPECT_EQ(report.caps, static_cast<int>(kParts));
    EXPECT_EQ(solid.triangles.size(), static_cast<std::size_t>(large) + 4 * kParts);
    EXPECT_NEAR(report.volume_ml, 4.0 / 3 * kPi * 1000, 20);
}

TEST(WindingNumber, IsOneInsideZeroOutsideAndTheTreeAgrees) {
    const Surface whole = ball_mesh({0, 0, 0}, 20), bowl = without_top(whole, 12);
    const WindingTree tree(bowl, 2), closed(whole, 2);
    HardCase off("winding number by the tree, off the direct sum", HardCase::at_most, 0.04, "");
    EXPECT_NEAR(winding_number(whole, {1, 2, 3}), 1, 1e-9);
    EXPECT_NEAR(winding_number(whole, {30, 2, 3}), 0, 1e-9);
    for (std::uint64_t n = 0; n < 200; ++n) {
        const Point3 p{60 * uniform_at(1, 3 * n) - 30, 60 * uniform_at(1, 3 * n + 1) - 30,
                       60 * uniform_at(1, 3 * n + 2) - 30};
        off.see(std::abs(tree.at(p) - winding_number(bowl, p)));
        off.see(std::abs(closed.at(p) - winding_number(whole, p)));
    }
}

TEST(Voxelise, ABallHasItsVolumeWhereverItLies) {
    const Grid grid = testing::cubic_grid(61);
    for (const Point3 c : {Point3{0, 0, 0}, Point3{0.3, 0.5, 0.1}, Point3{5, -3, 2}}) {
        MendReport report;
        const Surface solid = mend_mesh(ball_mesh(c, 20, 60), {}, &report);
        const VoxelMask mask = voxelise(solid, true, grid);
        EXPECT_NEAR(static_cast<double>(mask.count()) / 1000 / report.volume_ml, 1,
                    0.004);  // of 33 ml: lattice
    }
}

TEST(Voxelise, OverlappingPartsAreInsideAndNestedOnesToo) {
    const Grid grid = testing::cubic_grid(61);
    const Surface two = together(ball_mesh({-6, 0, 0}, 15), ball_mesh({6, 0, 0}, 15));
    const VoxelMask mask = voxelise(mend_mesh(two, {}, nullptr), true, grid);
    const auto inside = [&](int i, int j, int k) {
        return mask.inside[mask.index(30 + i - mask.first.x, 30 + j - mask.first.y,
                                      30 + k - mask.first.z)];
    };
    EXPECT_TRUE(inside(0, 0, 0));
    EXPECT_TRUE(inside(-15, 0, 0));
    EXPECT_FALSE(inside(0, 14, 0));
}

// A closed tube along a figure of eight in the plane z = 0: one surface that passes through itself.
constexpr double kEightRadiusMm = 6;
Point3 on_eight(double t) {
    return {30 * std::sin(t), 20 * std::sin(2 * t), 0};
}
Surface eight() {
    constexpr int kRings = 240, kAround = 24;
    Surface s;
    for (int ring = 0; ring < kRings; ++ring) {
        const double t = 2 * kPi * ring / kRings;
        const Vector3 along = normalized(Vector3{30 * std::cos(t), 40 * std::cos(2 * t), 0});
        const Vector3 side = cross({0, 0, 1}, along);
        for (int a = 0; a < kAround; ++a) {
            const double turn = 2 * kPi * a / kAround;
            s.points.push_back(on_eight(t) + kEightRadiusMm * (std::cos(turn) * side +
                                                               std::sin(turn) * Vector3{0, 0, 1}));
        }
    }
    for (int ring = 0; ring < kRings; ++ring) {
        for (int a = 0; a < kAround; ++a) {
            const auto at = [&](int r, int b) {
                return static_cast<std::uint32_t>(r % kRings * kAround + b % kAround);
            };
            s.triangles.push_back({at(ring, a), at(ring, a + 1), at(ring + 1, a)});
            s.triangles.push_back({at(ring, a + 1), at(ring + 1, a + 1), at(ring + 1, a)});
        }
    }
    return s;
}

// Where the two arms cross is inside, as if each were a solid of its own.
TEST(Voxelise, ASurfaceThatCrossesItselfIsTheUnionOfItsArms) {
    MendReport report;
    const Surface solid = mend_mesh(eight(), {}, &report);
    EXPECT_EQ(report.components, 1);
    EXPECT_EQ(report.open_loops, 0);
    const Grid grid = testing::cubic_grid(81);
    const VoxelMask mask = voxelise(solid, true, grid);
    int wrong = 0, inside = 0;
    for (int k = 0; k < 81; ++k) {
        for (int j = 0; j < 81; ++j) {
            for (int i = 0; i < 81; ++i) {
                const Point3 p = grid.point_from_voxel(
                    {static_cast<double>(i), static_cast<double>(j), static_cast<double>(k)});
                double nearest = 1e9;
                for (int n = 0; n < 360 && std::abs(p.z) < kEightRadiusMm + 1; ++n)
                    nearest = std::min(nearest, distance(p, on_eight(kPi * n / 180)));
                // Facets cut chords of 0.05 mm; the lattice of voxels is 1 mm.
                if (std::abs(nearest - kEightRadiusMm) < 0.25) continue;
                inside += nearest < kEightRadiusMm ? 1 : 0;
                const Int3 v{i - mask.first.x, j - mask.first.y, k - mask.first.z};
                const bool in_mask = v.x >= 0 && v.y >= 0 && v.z >= 0 && v.x < mask.size.x &&
                                     v.y < mask.size.y && v.z < mask.size.z;
                const bool covered = in_mask && mask.inside[mask.index(v.x, v.y, v.z)] != 0;
                wrong += covered != (nearest < kEightRadiusMm) ? 1 : 0;
            }
        }
    }
    EXPECT_GT(inside, 10000);
    HardCase crossing("wrong voxels of a surface that crosses itself", HardCase::at_most, 0, "");
    crossing.see(wrong);
}

TEST(Voxelise, AnOpenSurfaceGoesByWindingNumbers) {
    const Grid grid = testing::cubic_grid(61);
    const VoxelMask open = voxelise(without_top(ball_mesh({0, 0, 0}, 20, 60), 17), false, grid);
    // The cap that is missing has a height of 3 mm: pi h^2 (3 r - h) / 3 = 0.54 of 33.5 ml.
    HardCase off("volume of an open ball of 33.2 ml, off", HardCase::at_most, 0.6, "ml");
    off.see(std::abs(static_cast<double>(open.count()) / 1000 - 33.2));
}

TEST(FillLumen, FillsAPipeThatBends) {
    const Grid grid = testing::cubic_grid(81);
    VoxelMask wall;
    wall.size = grid.size;
    wall.inside.assign(grid.voxel_count(), 0);
    double lumen = 0;
    for (int k = 0; k < 81; ++k)
        for (int j = 0; j < 81; ++j)
            for (int i = 0; i < 81; ++i) {
                // A quarter of a torus about (10, 10): radius 45, pipe 8 with a wall of 2.
                const double x = i - 10, y = j - 10, z = k - 40;
                const double r = std::hypot(std::hypot(x, y) - 45, z);
                if (x < 2 || y < 2) continue;
                wall.inside[grid.index(i, j, k)] = r < 8 && r >= 6;
                lumen += r < 6;
            }
    const auto added = static_cast<double>(fill_lumen(wall, {1, 400}));
    EXPECT_NEAR(added / lumen, 1, 0.12);  // its ends stay open or bulge by a voxel
}

}  // namespace
}  // namespace sonocase::pipeline
