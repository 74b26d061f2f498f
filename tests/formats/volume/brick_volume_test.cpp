// SPDX-License-Identifier: Apache-2.0

#include "formats/volume/brick_volume.h"

#include <gtest/gtest.h>

#include "support/random.h"

namespace sonocase {
namespace {

TEST(BrickVolume, DenseRoundTripAtSizesAroundABrick) {
    testing::Random random(7);
    for (const Int3 size :
         {Int3{1, 1, 1}, Int3{4, 4, 4}, Int3{5, 3, 9}, Int3{8, 1, 4}, Int3{13, 17, 6}}) {
        std::vector<std::uint8_t> dense(static_cast<std::size_t>(size.x * size.y * size.z));
        for (auto& v : dense) v = static_cast<std::uint8_t>(random.uniform(0, 1.3));
        const auto bricks = bricks_from_dense<std::uint8_t>(dense, size);
        EXPECT_EQ(dense_from_bricks(bricks), dense);
    }
}

TEST(BrickVolume, UniformVolumeStoresNoBrick) {
    const std::vector<std::uint32_t> dense(20 * 20 * 20, 0xFFu);
    const auto bricks = bricks_from_dense<std::uint32_t>(dense, {20, 20, 20});
    EXPECT_TRUE(bricks.pool.empty());
    EXPECT_EQ(bricks.uniform.size(), 1u);
    EXPECT_EQ(bricks.at(19, 19, 19), 0xFFu);
}

TEST(BrickVolume, OneOddVoxelStoresOneBrick) {
    std::vector<std::int8_t> dense(16 * 16 * 16, -3);
    dense[5 + 16 * (6 + 16 * 7)] = 4;
    const auto bricks = bricks_from_dense<std::int8_t>(dense, {16, 16, 16});
    EXPECT_EQ(bricks.pool.size(), static_cast<std::size_t>(kBrickVoxels));
    EXPECT_EQ(bricks.at(5, 6, 7), 4);
    EXPECT_EQ(bricks.at(6, 6, 7), -3);
}

}  // namespace
}  // namespace sonocase
