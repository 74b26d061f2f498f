// SPDX-License-Identifier: Apache-2.0

#include "pipeline/registration/skin/skin_surface.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "pipeline/anatomy/analytic_torso.h"

namespace sonocase::pipeline {
namespace {

double measure(const StageReport& report, const std::string& name) {
    for (const Measure& m : report.measures) {
        if (m.name == name) return m.value;
    }
    ADD_FAILURE() << "no measure " << name;
    return NAN;
}

// An elliptic cylinder along k, semi-axes 150 and 100 mm, in a grid of h mm.
constexpr double kA = 150, kB = 100;

LabelVolume cylinder(double h, double half_width = 180, double half_depth = 130) {
    LabelVolume v;
    v.labels = {{"outside", "", 0, {}}, {"body", "", 1, {}}};
    v.grid.spacing_mm = {h, h, h};
    v.grid.size = {static_cast<int>(2 * half_width / h), static_cast<int>(2 * half_depth / h),
                   static_cast<int>(180 / h)};
    v.grid.origin_mm = {-half_width + h / 2, -half_depth + h / 2, 40 + h / 2};
    v.voxels.resize(v.grid.voxel_count());
    for (int k = 0; k < v.grid.size.z; ++k) {
        for (int j = 0; j < v.grid.size.y; ++j) {
            for (int i = 0; i < v.grid.size.x; ++i) {
                const Point3 p = v.grid.point_from_voxel({1.0 * i, 1.0 * j, 1.0 * k});
                v.voxels[v.grid.index(i, j, k)] =
                    p.x * p.x / (kA * kA) + p.y * p.y / (kB * kB) <= 1;
            }
        }
    }
    return v;
}

void paint_box(LabelVolume& v, Point3 lower, Point3 upper, std::uint8_t label) {
    for (int k = 0; k < v.grid.size.z; ++k) {
        for (int j = 0; j < v.grid.size.y; ++j) {
            for (int i = 0; i < v.grid.size.x; ++i) {
                const Point3 p = v.grid.point_from_voxel({1.0 * i, 1.0 * j, 1.0 * k});
                if (p.x >= lower.x && p.y >= lower.y && p.z >= lower.z && p.x <= upper.x &&
                    p.y <= upper.y && p.z <= upper.z) {
                    v.voxels[v.grid.index(i, j, k)] = label;
                }
            }
        }
    }
}

// First-order distance to the cylinder's wall.
double wall_distance(Point3 p) {
    const double f = p.x * p.x / (kA * kA) + p.y * p.y / (kB * kB) - 1;
    return f / (2 * std::hypot(p.x / (kA * kA), p.y / (kB * kB)));
}

TEST(SkinSurface, LiesOnTheWallToATenthOfAVoxelAndPointsOutwards) {
    const auto result = extract_skin_surface(cylinder(3));
    ASSERT_TRUE(result) << result.error().message();
    double sum = 0, worst = 0, worst_normal = 1;
    for (std::size_t i = 0; i < result->skin.points.size(); ++i) {
        const Point3 p = result->skin.points[i];
        const double d = wall_distance(p);
        sum += d;
        worst = std::max(worst, std::abs(d));
        const Vector3 normal = normalized({p.x / (kA * kA), p.y / (kB * kB), 0});
        worst_normal = std::min(worst_normal, dot(normal, result->skin.normals[i]));
    }
    // A binary mask of 3 mm voxels gives its edge to half a voxel; the mean is exact. The
    // Gaussian of 2 mm pulls a wall whose smallest radius R is 67 mm in by sigma^2 / 2R = 0.03 mm.
    EXPECT_LT(std::abs(sum / static_cast<double>(result->skin.points.size())), 0.1);
    EXPECT_LT(worst, 1.5);
    EXPECT_GT(worst_normal, std::cos(0.5));  // steps of a binary mask, softened
    for (const auto& t : result->skin.triangles) {
        const auto& p = result->skin.points;
        const Vector3 n = cross(p[t[1]] - p[t[0]], p[t[2]] - p[t[0]]);
        ASSERT_GE(dot(n, result->skin.normals[t[0]]), -1e-9);
    }
}

TEST(SkinSurface, FineVoxelsAreAveragedAndFollowTheWallMoreClosely) {
    const auto result = extract_skin_surface(cylinder(1));
    ASSERT_TRUE(result);
    double worst = 0;
    for (const Point3 p : result->skin.points) worst = std::max(worst, std::abs(wall_distance(p)));
    EXPECT_LT(worst, 0.5);  // half of a voxel of the source
}

TEST(SkinSurface, IsOpenWhereTheGridCutsTheBody) {
    const auto result = extract_skin_surface(cylinder(3, 120, 130));  // flanks cut at x = +-120
    ASSERT_TRUE(result);
    long rim = 0;
    for (std::size_t i = 0; i < result->skin.points.size(); ++i) {
        // A cut face would have points off the wall.
        EXPECT_LT(std::abs(wall_distance(result->skin.points[i])), 1.6);
        rim += result->on_rim[i];
    }
    EXPECT_GT(rim, 100);
    EXPECT_GT(measure(result->report, "cut_face_points"), 1000);
}

TEST(SkinSurface, IsOpenWhereThePaddedGridHidesTheCut) {
    LabelVolume v = cylinder(3, 180, 130);
    paint_box(v, {-400, -400, -400}, {-120, 400, 400}, 0);  // cut at x = -120, air beyond
    paint_box(v, {-400, -400, -400}, {400, 400, 70}, 0);    // cut at z = 70
    const auto result = extract_skin_surface(v);
    ASSERT_TRUE(result);
    for (const Point3 p : result->skin.points) EXPECT_LT(std::abs(wall_distance(p)), 1.6);
}

TEST(SkinSurface, TableAndArmsAreLeftOutAndCounted) {
    LabelVolume v = cylinder(3, 240, 150);
    paint_box(v, {-200, -112, 40}, {200, -102, 220}, 1);  // a table that touches the back
    paint_box(v, {180, -20, 40}, {225, 25, 220}, 1);      // an arm beside the trunk
    const auto result = extract_skin_surface(v);
    ASSERT_TRUE(result);
    EXPECT_GT(measure(result->report, "table_points"), 500);
    EXPECT_GT(measure(result->report, "arm_points"), 500);
    for (const Point3 p : result->skin.points) {
        // Where the table touches the trunk a strip stays joined: up to a bridge's thickness.
        EXPECT_LT(wall_distance(p), 8) << p.x << " " << p.y << " " << p.z;
        EXPECT_LT(p.x, 160);
    }
}

TEST(SkinSurface, AnyAxisOrderAndHandednessGivesTheSameSkin) {
    const LabelVolume v = cylinder(3);
    LabelVolume flipped = v;  // i runs to the left, j to the head, k to the front
    flipped.grid.size = {v.grid.size.x, v.grid.size.z, v.grid.size.y};
    flipped.grid.direction = Matrix3::from_columns({-1, 0, 0}, {0, 0, 1}, {0, 1, 0});
    flipped.grid.origin_mm = v.grid.point_from_voxel({v.grid.size.x - 1.0, 0, 0});
    for (int k = 0; k < v.grid.size.z; ++k) {
        for (int j = 0; j < v.grid.size.y; ++j) {
            for (int i = 0; i < v.grid.size.x; ++i) {
                flipped.voxels[flipped.grid.index(v.grid.size.x - 1 - i, k, j)] =
                    v.voxels[v.grid.index(i, j, k)];
            }
        }
    }
    const auto a = extract_skin_surface(v), b = extract_skin_surface(flipped);
    ASSERT_TRUE(a);
    ASSERT_TRUE(b);
    for (std::size_t i = 0; i < b->skin.points.size(); ++i) {
        ASSERT_LT(std::abs(wall_distance(b->skin.points[i])), 1.6);
        const Point3 p = b->skin.points[i];
        ASSERT_GT(dot(normalized({p.x / (kA * kA), p.y / (kB * kB), 0}), b->skin.normals[i]), 0.85);
    }
    for (const auto& t : b->skin.triangles) {
        const auto& p = b->skin.points;
        ASSERT_GE(dot(cross(p[t[1]] - p[t[0]], p[t[2]] - p[t[0]]), b->skin.normals[t[0]]), -1e-9);
    }
}

TEST(SkinSurface, AMapWithoutABodySaysSo) {
    LabelVolume v = cylinder(3);
    std::fill(v.voxels.begin(), v.voxels.end(), std::uint8_t{0});
    auto result = extract_skin_surface(v);
    ASSERT_FALSE(result);
    EXPECT_NE(result.error().message().find("no body"), std::string::npos);
    std::fill(v.voxels.begin(), v.voxels.end(), std::uint8_t{1});
    result = extract_skin_surface(v);
    ASSERT_FALSE(result);
}

TEST(SkinSurface, OfTheAnalyticTorsoLiesOnItsSkin) {
    const LabelVolume v = sample_analytic_torso(analytic_torso_grid({1, 1, 5}));
    const auto result = extract_skin_surface(v);
    ASSERT_TRUE(result);
    double sum = 0;
    int count = 0;
    for (std::size_t i = 0; i < result->skin.points.size(); i += 23, ++count) {
        sum += std::abs(analytic_torso_signed_distance(0, result->skin.points[i]));
    }
    EXPECT_LT(sum / count, 0.4);
    EXPECT_EQ(measure(result->report, "table_points"), 0);
    EXPECT_EQ(measure(result->report, "arm_points"), 0);
}

}  // namespace
}  // namespace sonocase::pipeline
