// SPDX-License-Identifier: Apache-2.0

#include "pipeline/anatomy/bake_structure.h"

#include <gtest/gtest.h>

#include <cmath>
#include <map>

#include "formats/base/constants.h"
#include "pipeline/anatomy/analytic_torso.h"
#include "pipeline/anatomy/tissue_table.h"
#include "pipeline/base/parallel.h"

namespace sonocase::pipeline {
namespace {

const LabelVolume& torso() {
    static const LabelVolume volume = sample_analytic_torso(analytic_torso_grid({2, 2, 2}));
    return volume;
}

const BakeStructureResult& baked() {
    static const BakeStructureResult result = [] {
        auto r = bake_structure(torso(), built_in_tissues());
        return *r;
    }();
    return result;
}

TEST(BakeStructure, LeavesTheMeanEchoOfEveryLabel) {
    const std::vector<std::int8_t> offsets = dense_from_bricks(baked().echo_offset);
    std::map<int, double> sum, count;
    for (std::size_t i = 0; i < offsets.size(); ++i) {
        sum[torso().voxels[i]] += offsets[i] / 4.0;
        count[torso().voxels[i]] += 1;
    }
    for (const auto& [label, n] : count) {
        // levels are quarter dB: the mean is level to an eighth, and the bar is 0.3
        EXPECT_NEAR(sum[label] / n, 0, 0.2) << torso().labels[label].name;
    }
}

TEST(BakeStructure, FluidGasBoneAndOutsideHaveNone) {
    const std::vector<std::int8_t> offsets = dense_from_bricks(baked().echo_offset);
    for (std::size_t i = 0; i < offsets.size(); ++i) {
        const Tissue* t = find_tissue(torso().labels[torso().voxels[i]].tissue);
        if (t->kind == TissueKind::soft) continue;
        ASSERT_EQ(offsets[i], 0) << t->name;
    }
}

TEST(BakeStructure, SameBytesForAnyNumberOfThreads) {
    const ThreadLimit limit(1);
    auto again = bake_structure(torso(), built_in_tissues());
    ASSERT_TRUE(again);
    EXPECT_EQ(again->echo_offset.pool, baked().echo_offset.pool);
    EXPECT_EQ(again->echo_offset.table, baked().echo_offset.table);
}

TEST(BakeStructure, SwitchedOffThereIsNothing) {
    BakeStructureOptions options;
    options.parenchyma = options.liver_vessels = options.kidney = options.muscle_fibres = false;
    options.fat_septa = options.bowel_wall = options.fascia = false;
    auto r = bake_structure(torso(), built_in_tissues(), options);
    ASSERT_TRUE(r);
    EXPECT_TRUE(r->echo_offset.pool.empty());
    EXPECT_TRUE(r->trees.empty());
}

// A solid box of liver with a portal vein at its side and the cava on top.
LabelVolume liver_block() {
    LabelVolume v;
    v.grid.size = {120, 120, 120};
    v.grid.spacing_mm = {1.25, 1.25, 1.25};
    v.grid.origin_mm = {-40, 10, 5};
    v.voxels.assign(v.grid.voxel_count(), 0);
    v.labels = {{"outside", "outside"},
                {"liver", "liver"},
                {"portal_vein_and_splenic_vein", "blood"},
                {"inferior_vena_cava", "blood"}};
    for (int k = 0; k < 120; ++k)
        for (int j = 0; j < 120; ++j)
            for (int i = 0; i < 120; ++i) {
                std::uint8_t& l = v.voxels[v.grid.index(i, j, k)];
                if (std::hypot(i - 60.0, j - 60.0) < 50 && k > 10 && k < 105) l = 1;
                if (std::hypot(i - 60.0, j - 60.0) < 5 && k < 20) l = 2;
                if (std::hypot(i - 60.0, j - 85.0) < 8 && k > 90) l = 3;
            }
    return v;
}

TEST(VesselTree, ConnectedInsideTheOrganWithMurrayRadii) {
    const LabelVolume v = liver_block();
    auto r = bake_structure(v, built_in_tissues());
    ASSERT_TRUE(r);
    ASSERT_EQ(r->trees.size(), 2u);
    for (const VesselTree& tree : r->trees) {
        ASSERT_GT(tree.nodes.size(), 100u);
        EXPECT_EQ(tree.nodes[0].parent, -1);
        std::vector<double> children(tree.nodes.size(), 0);
        int leaves = 0, forks = 0;
        std::vector<int> child_count(tree.nodes.size(), 0);
        for (std::size_t n = 1; n < tree.nodes.size(); ++n) {
            const VesselNode& node = tree.nodes[n];
            ASSERT_GE(node.parent, 0);
            ASSERT_LT(node.parent, static_cast<int>(n));
            const auto parent = static_cast<std::size_t>(node.parent);
            EXPECT_NEAR(distance(node.position, tree.nodes[parent].position), 2.5, 1e-9);
            EXPECT_GE(node.radius_mm, 0.9);
            EXPECT_LE(node.radius_mm, tree.nodes[parent].radius_mm + 1e-12);
            children[parent] += std::pow(node.radius_mm, 3);
            ++child_count[parent];
            const Point3 p = v.grid.voxel_from_point(node.position);
            const auto at =
                v.grid.index(static_cast<int>(std::lround(p.x)), static_cast<int>(std::lround(p.y)),
                             static_cast<int>(std::lround(p.z)));
            EXPECT_EQ(v.voxels[at], 1);
        }
        for (std::size_t n = 0; n < tree.nodes.size(); ++n) {
            // branches that were too thin to keep leave a gap, never a surplus
            EXPECT_LE(children[n], std::pow(tree.nodes[n].radius_mm, 3) * (1 + 1e-9));
            leaves += child_count[n] == 0;
            forks += child_count[n] > 1;
        }
        EXPECT_GT(forks, 10) << "a tree, not a line";
        EXPECT_GT(leaves, 10);
    }
}

TEST(VesselTree, NoneWhereTheLabelsHaveIt) {
    LabelVolume v = liver_block();
    v.labels.push_back({"liver_vessels", "blood"});
    v.voxels[v.grid.index(60, 60, 60)] = 4;
    auto r = bake_structure(v, built_in_tissues());
    ASSERT_TRUE(r);
    EXPECT_TRUE(r->trees.empty());
}

// The direction in which offsets change the least, by the structure tensor of central differences.
Vector3 fibre_direction(const LabelVolume& v, const std::vector<std::int8_t>& o, int label) {
    double t[3][3] = {};
    for (int k = 2; k < v.grid.size.z - 2; ++k)
        for (int j = 2; j < v.grid.size.y - 2; ++j)
            for (int i = 2; i < v.grid.size.x - 2; ++i) {
                bool inside = true;
                for (int d = -2; d <= 2; ++d)
                    inside = inside && v.voxels[v.grid.index(i + d, j, k)] == label &&
                             v.voxels[v.grid.index(i, j + d, k)] == label &&
                             v.voxels[v.grid.index(i, j, k + d)] == label;
                if (!inside) continue;
                const double g[3] = {static_cast<double>(o[v.grid.index(i + 1, j, k)] -
                                                         o[v.grid.index(i - 1, j, k)]),
                                     static_cast<double>(o[v.grid.index(i, j + 1, k)] -
                                                         o[v.grid.index(i, j - 1, k)]),
                                     static_cast<double>(o[v.grid.index(i, j, k + 1)] -
                                                         o[v.grid.index(i, j, k - 1)])};
                for (int a = 0; a < 3; ++a)
                    for (int b = 0; b < 3; ++b) t[a][b] += g[a] * g[b];
            }
    // smallest eigenvector: power iteration on trace - T
    const double trace = t[0][0] + t[1][1] + t[2][2];
    Vector3 d = normalized({0.3, 0.5, 0.7});
    for (int n = 0; n < 2000; ++n) {
        Vector3 e{};
        for (int a = 0; a < 3; ++a) {
            e[a] = trace * d[a];
            for (int b = 0; b < 3; ++b) e[a] -= t[a][b] * d[b];
        }
        d = normalized(e);
    }
    return d;
}

TEST(MuscleFibres, FollowTheMuscleWithinTenDegrees) {
    // slanted spindles of muscle in a box of fat
    for (const Vector3 slant :
         {Vector3{0, 0, 1}, Vector3{0.5, 0.2, 0.9}, Vector3{0.8, -0.5, 0.35}}) {
        const Vector3 axis = normalized(slant);
        LabelVolume v;
        v.grid.size = {96, 96, 96};
        v.voxels.assign(v.grid.voxel_count(), 1);
        v.labels = {{"outside", "outside"}, {"other_fat", "fat"}, {"iliopsoas_left", "muscle"}};
        for (int k = 0; k < 96; ++k)
            for (int j = 0; j < 96; ++j)
                for (int i = 0; i < 96; ++i) {
                    const Vector3 p{i - 47.5, j - 47.5, k - 47.5};
                    const double a = dot(p, axis), r = norm(p - a * axis);
                    if ((a / 46) * (a / 46) + (r / 17) * (r / 17) < 1)
                        v.voxels[v.grid.index(i, j, k)] = 2;
                }
        auto r = bake_structure(v, built_in_tissues());
        ASSERT_TRUE(r);
        ASSERT_EQ(r->fibres.size(), 1u);
        const double cosine = std::cos(10 * kRadPerDeg);
        EXPECT_GT(std::abs(dot(r->fibres[0].axis, axis)), cosine);
        const Vector3 found = fibre_direction(v, dense_from_bricks(r->echo_offset), 2);
        EXPECT_GT(std::abs(dot(found, r->fibres[0].axis)), cosine);
    }
}

TEST(BakeStructure, UnknownTissueAndUnevenVoxelsAreRefused) {
    LabelVolume v = liver_block();
    v.labels[1].tissue = "lvier";
    auto r = bake_structure(v, built_in_tissues());
    ASSERT_FALSE(r);
    EXPECT_NE(r.error().message().find("lvier"), std::string::npos);
    v = liver_block();
    v.grid.spacing_mm.z = 3;
    EXPECT_FALSE(bake_structure(v, built_in_tissues()));
}

TEST(BakeStructure, TinyVolumesAndLonelyVoxelsAreFine) {
    for (const Int3 size : {Int3{1, 1, 1}, Int3{3, 1, 2}, Int3{40, 2, 5}}) {
        LabelVolume v;
        v.grid.size = size;
        v.labels = {{"outside", "outside"}, {"liver", "liver"}, {"m", "muscle"},
                    {"f", "fat"},           {"b", "bowel"},     {"kidney_left", "kidney_cortex"}};
        v.voxels.resize(v.grid.voxel_count());
        for (std::size_t i = 0; i < v.voxels.size(); ++i)
            v.voxels[i] = static_cast<std::uint8_t>(i % 6);
        auto r = bake_structure(v, built_in_tissues());
        ASSERT_TRUE(r);
        EXPECT_EQ(r->echo_offset.size, size);
    }
}

}  // namespace
}  // namespace sonocase::pipeline
