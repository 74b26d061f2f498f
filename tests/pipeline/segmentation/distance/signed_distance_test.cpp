// SPDX-License-Identifier: Apache-2.0

#include "pipeline/segmentation/distance/signed_distance.h"

#include <gtest/gtest.h>

#include <cmath>

#include "support/random.h"
#include "support/shapes.h"

namespace sonocase::pipeline {
namespace {

using sonocase::testing::cubic_grid;
using sonocase::testing::Random;
using sonocase::testing::sample_labels;

LabelVolume random_blobs(std::uint64_t seed, Vector3 spacing_mm) {
    Random random(seed);
    Grid grid = cubic_grid(12);
    grid.spacing_mm = spacing_mm;
    LabelVolume volume = sample_labels(grid, 3, [](Point3) { return 0; });
    for (auto& v : volume.voxels) v = static_cast<std::uint8_t>(random.uniform(0, 1) < 0.1 ? 1 : 2);
    return volume;
}

TEST(SignedDistance, EqualsSearchOverAllVoxels) {
    const std::uint64_t seed = 11;
    SCOPED_TRACE(seed);
    const LabelVolume volume = random_blobs(seed, {1, 1.5, 2});
    const VoxelBox box{{0, 0, 0}, volume.grid.size};
    std::vector<float> phi;
    signed_distance(volume, 1, box, 3.0, {true, true, true}, &phi);
    const double half = 0.75;  // half the mean spacing
    for (int k = 0; k < 12; ++k) {
        for (int j = 0; j < 12; ++j) {
            for (int i = 0; i < 12; ++i) {
                const bool in = volume.voxels[volume.grid.index(i, j, k)] == 1;
                double nearest = 1e9;
                for (int c = 0; c < 12; ++c) {
                    for (int b = 0; b < 12; ++b) {
                        for (int a = 0; a < 12; ++a) {
                            if ((volume.voxels[volume.grid.index(a, b, c)] == 1) == in) continue;
                            const double x = i - a, y = 1.5 * (j - b), z = 2.0 * (k - c);
                            nearest = std::min(nearest, std::sqrt(x * x + y * y + z * z));
                        }
                    }
                }
                const double expected = std::min(nearest - half, 3.0) * (in ? -1 : 1);
                // Single precision of squares up to 16.
                ASSERT_NEAR(phi[box.index(i, j, k)], expected, 1e-5);
            }
        }
    }
}

TEST(SignedDistance, SliceModeNeverLooksAtAnotherSlice) {
    const LabelVolume volume = random_blobs(12, {1, 1, 5});
    const VoxelBox box{{0, 0, 0}, volume.grid.size};
    std::vector<float> phi;
    signed_distance(volume, 1, box, 4.0, {true, true, false}, &phi);
    for (int k = 0; k < 12; ++k) {
        LabelVolume slice = volume;
        slice.grid.size.z = 1;
        slice.voxels.assign(volume.voxels.begin() + k * 144, volume.voxels.begin() + (k + 1) * 144);
        std::vector<float> alone;
        signed_distance(slice, 1, {{0, 0, 0}, slice.grid.size}, 4.0, {true, true, true}, &alone);
        for (std::size_t v = 0; v < 144; ++v) {
            // Half a voxel is the mean spacing of the axes measured: 7/3 against 1.
            const float shift = volume.voxels[k * 144 + v] == 1 ? -1.f : 1.f;
            const float a = phi[k * 144 + v] * shift;
            const float b = alone[v] * shift + static_cast<float>(0.5 * (7.0 / 3 - 1));
            ASSERT_NEAR(a, std::min(b, 4.0f), 1e-5) << k << " " << v;
        }
    }
}

TEST(SignedDistance, BoxesOfLabelsAreTight) {
    const LabelVolume volume = sample_labels(
        cubic_grid(9), 4, [](Point3 p) { return p.x == 1 && p.y >= -2 && p.z <= 0 ? 2 : 0; });
    const auto boxes = label_boxes(volume);
    EXPECT_TRUE(boxes[1].empty());
    EXPECT_EQ(boxes[2].first, (Int3{5, 2, 0}));
    EXPECT_EQ(boxes[2].size, (Int3{1, 7, 5}));
    EXPECT_EQ(grow(boxes[2], {1, 3, 1}, {9, 9, 9}).size, (Int3{3, 9, 6}));
}

}  // namespace
}  // namespace sonocase::pipeline
