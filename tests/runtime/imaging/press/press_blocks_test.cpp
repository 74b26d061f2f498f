// SPDX-License-Identifier: Apache-2.0

// The press field against a nonlinear finite element model of three blocks of tissue.
#include <gtest/gtest.h>

#include <filesystem>

#include "runtime/imaging/press/fem_block.h"
#include "support/paths.h"

namespace sonocase::testing {
namespace {

struct Bar {
    double pressed_mm, mean_mm, p95_mm;
};

// The finite elements are trusted to 12 mm, where they bound the model and not the other way round.
constexpr Bar kBars[] = {{2, 0.15, 0.4}, {4, 0.25, 0.5}, {8, 0.5, 1.2}, {12, 1.0, 2.8}};

class PressBlocks : public ::testing::TestWithParam<const char*> {};

TEST_P(PressBlocks, DisplacementsAreasAndForceLieWithinTheBars) {
    const std::string folder = std::string(SONOCASE_DATA "/deformation/") + GetParam();
    if (!std::filesystem::exists(folder)) GTEST_SKIP() << "no " << folder;
    const auto block = read_fem_block(folder);
    ASSERT_TRUE(block) << block.error().message();
    EXPECT_EQ(block->face.half_width_mm, 20);
    EXPECT_EQ(block->face.half_height_mm, 4);
    runtime::press::PressField field(block->face);
    for (const FemState& state : block->states) {
        const BlockError e = compare(*block, state, field);
        const auto bar = std::find_if(std::begin(kBars), std::end(kBars), [&](const Bar& b) {
            return b.pressed_mm == state.pressed_mm;
        });
        ASSERT_NE(bar, std::end(kBars));
        EXPECT_LE(e.mean_mm, bar->mean_mm) << e.pressed_mm;
        EXPECT_LE(e.p95_mm, bar->p95_mm) << e.pressed_mm;
        if (e.pressed_mm <= 8) {
            EXPECT_LE(e.off_plane_mean_mm, 0.4) << e.pressed_mm;
        }
        EXPECT_GE(e.force_n, 0.8 * e.fem_force_n) << e.pressed_mm;
        EXPECT_LE(e.force_n, 1.25 * e.fem_force_n) << e.pressed_mm;
        if (block->vein >= 0) {
            EXPECT_NEAR(e.vein_area, e.fem_vein_area, 0.06) << e.pressed_mm;
        }
        if (block->artery >= 0) {
            EXPECT_NEAR(e.artery_area, e.fem_artery_area, 0.05) << e.pressed_mm;
        }
        EXPECT_GT(field.state().min_determinant, 0.01) << e.pressed_mm;
    }
}

INSTANTIATE_TEST_SUITE_P(All, PressBlocks, ::testing::Values("vessel", "vesselbone", "homog"));

// Blocks made by scripts/press-blocks: skin that slopes in steps, a limb, a vein right below the
// skin, the abdomen under a face as wide as a curved probe's, a rib under half of the face. Their
// elements of 2.5 mm are stiffer than those of 1.25 mm above, those of 2 mm by 8 % (homogeneous
// tissue at 4 mm), so the bounds of 0.8 and 1.3 are 0.74 and 1.2 here.
class PressForces : public ::testing::TestWithParam<const char*> {};

TEST_P(PressForces, LieNearTheFiniteElementsWhateverTheShape) {
    const auto block =
        read_fem_block(std::string(SONOCASE_SOURCE "/tests/data/press_blocks/") + GetParam());
    ASSERT_TRUE(block) << block.error().message();
    ASSERT_FALSE(block->states.empty());
    runtime::press::PressField field(block->face);
    for (const FemState& state : block->states) {
        const BlockError e = compare(*block, state, field);
        std::printf("%-6s %4.0f mm: %.2f of the finite elements\n", GetParam(), e.pressed_mm,
                    e.force_n / e.fem_force_n);
        EXPECT_GE(e.force_n, 0.74 * e.fem_force_n) << e.pressed_mm;
        EXPECT_LE(e.force_n, 1.2 * e.fem_force_n) << e.pressed_mm;
    }
}

INSTANTIATE_TEST_SUITE_P(All,
                         PressForces,
                         ::testing::Values("slope", "ridge", "vein", "wide", "rib"));

TEST(PressBlock, WhatIsNotABlockIsRefusedWithItsName) {
    const auto missing = read_fem_block("/nowhere");
    ASSERT_FALSE(missing);
    EXPECT_NE(missing.error().message().find("/nowhere/block.json"), std::string::npos);
}

}  // namespace
}  // namespace sonocase::testing
