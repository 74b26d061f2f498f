// SPDX-License-Identifier: Apache-2.0

#include "pipeline/anatomy/bake_structure.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <vector>

#include "pipeline/anatomy/tissue_table.h"

namespace sonocase::pipeline {
namespace {

// A ball of liver in muscle; the edge is not a multiple of a brick's.
LabelVolume ball(int edge, double voxel_mm) {
    LabelVolume volume;
    volume.grid.size = {edge, edge, edge};
    volume.grid.spacing_mm = {voxel_mm, voxel_mm, voxel_mm};
    volume.labels = {
        {"outside", "outside", 0, {}}, {"wall", "muscle", 1, {}}, {"liver", "liver", 2, {}}};
    const double middle = 0.5 * (edge - 1);
    for (int k = 0; k < edge; ++k) {
        for (int j = 0; j < edge; ++j) {
            for (int i = 0; i < edge; ++i) {
                const double r = voxel_mm * norm(Vector3{i - middle, j - middle, k - middle});
                volume.voxels.push_back(r < 7 ? 2 : r < 11 ? 1 : 0);
            }
        }
    }
    return volume;
}

TEST(StructureCells, AreAsLargeAsAMillimetreAllows) {
    EXPECT_EQ(structure_cell(1), 1);
    EXPECT_EQ(structure_cell(0.51), 1);
    EXPECT_EQ(structure_cell(0.5), 2);
    EXPECT_EQ(structure_cell(0.25), 4);
    EXPECT_EQ(structure_cell(0.2), 4);
}

TEST(StructureCells, WholeMillimetresAreBakedAsTheyAre) {
    const LabelVolume volume = ball(24, 1);
    const auto plain = bake_structure(volume, built_in_tissues());
    const auto cells = bake_structure_in_cells(volume, built_in_tissues());
    ASSERT_TRUE(plain && cells);
    EXPECT_EQ(plain->echo_offset.pool, cells->echo_offset.pool);
}

TEST(StructureCells, HalfMillimetresShareAValueBetweenEight) {
    const LabelVolume volume = ball(45, 0.5);
    const auto baked = bake_structure_in_cells(volume, built_in_tissues());
    ASSERT_TRUE(baked);
    const BrickVolume<std::int8_t>& echo = baked->echo_offset;
    EXPECT_EQ(echo.size, volume.grid.size);
    bool any = false;
    for (int k = 0; k < 45; ++k) {
        for (int j = 0; j < 45; ++j) {
            for (int i = 0; i < 45; ++i) {
                EXPECT_EQ(echo.at(i, j, k), echo.at(i / 2 * 2, j / 2 * 2, k / 2 * 2));
                any = any || echo.at(i, j, k) != 0;
            }
        }
    }
    EXPECT_TRUE(any);
}

}  // namespace
}  // namespace sonocase::pipeline
