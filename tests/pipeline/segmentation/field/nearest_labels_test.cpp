// SPDX-License-Identifier: Apache-2.0

// The grid of cooked labels, and nearest-neighbour resampling into it.
#include "pipeline/segmentation/nearest_labels.h"

#include <gtest/gtest.h>

#include <cmath>

#include "pipeline/segmentation/cooked_grid.h"
#include "pipeline/segmentation/known_maps.h"
#include "support/random.h"
#include "support/shapes.h"

namespace sonocase::pipeline {
namespace {

using namespace sonocase::testing;  // shapes and maps of known answer

TEST(CookedGrid, HoldsTheWarpedBodyAndNotMuchMore) {
    const std::uint64_t seed = 3;
    SCOPED_TRACE(seed);
    Random random(seed);
    const LabelVolume volume =
        sample_labels(cubic_grid(40), 2, [](Point3 p) { return norm_of(p) <= 15 ? 1 : 0; });
    const Rigid motion = random.rigid(100);
    const auto grid = cooked_grid(volume, rigid_registration(motion, volume.grid), {0.5, 3});
    ASSERT_TRUE(grid);
    const Box3 box = grid->bounds();
    const Point3 centre = motion * Point3{};
    for (int a = 0; a < 3; ++a) {
        // Radius 15, margin 3, and at most a voxel's diagonal and a rounding of the origin more.
        EXPECT_LE(box.lower[a], centre[a] - 17.5);
        EXPECT_GE(box.lower[a], centre[a] - 20);
        EXPECT_GE(box.upper[a], centre[a] + 17.5);
        EXPECT_LE(box.upper[a], centre[a] + 20);
    }
}

TEST(CookedGrid, RefusesAMapWithoutABody) {
    const LabelVolume volume = sample_labels(cubic_grid(4), 2, [](Point3) { return 0; });
    const auto grid = cooked_grid(volume, rigid_registration({}, volume.grid));
    ASSERT_FALSE(grid);
    EXPECT_NE(grid.error().message().find("no body"), std::string::npos);
}

TEST(NearestLabels, IdentityCopiesTheVoxels) {
    const LabelVolume volume = sample_labels(cubic_grid(16), 3, [](Point3 p) {
        return norm_of(p) > 6 ? 0 : p.x < p.y ? 1 : 2;
    });
    PreimageCounts counts;
    const LabelVolume out =
        nearest_labels(volume, rigid_registration({}, volume.grid), volume.grid, &counts);
    EXPECT_EQ(out.voxels, volume.voxels);
    EXPECT_EQ(counts.outside + counts.no_preimage, 0u);
}

TEST(NearestLabels, VoxelsBeyondTheCtAreBackgroundAndCounted) {
    const LabelVolume volume = sample_labels(cubic_grid(10), 2, [](Point3) { return 1; });
    Grid wide = cubic_grid(20);
    PreimageCounts counts;
    const LabelVolume out =
        nearest_labels(volume, rigid_registration({}, volume.grid), wide, &counts);
    EXPECT_EQ(count_label(out, 1), 1000u);
    EXPECT_EQ(counts.outside, 8000u - 1000u);
}

TEST(MappedVolumes, ScaleWithTheMap) {
    const LabelVolume volume =
        sample_labels(cubic_grid(20), 2, [](Point3 p) { return norm_of(p) <= 8 ? 1 : 0; });
    Registration registration = rigid_registration({}, volume.grid);
    for (auto& row : registration.quadratic.coefficients) {
        for (double& c : row) c *= 2;
    }
    const double ml = static_cast<double>(count_label(volume, 1)) / 1000;
    EXPECT_NEAR(mapped_volumes_ml(volume, registration)[1], 8 * ml, 1e-9);
}

TEST(MappedVolumes, BoxesOfALargeMapGiveTheSame) {
    LabelVolume volume =
        sample_labels(cubic_grid(61), 2, [](Point3 p) { return norm_of(p) <= 26 ? 1 : 0; });
    for (int a = 0; a < 3; ++a) volume.grid.spacing_mm[a] = 0.75;
    Registration registration = rigid_registration({}, volume.grid);
    registration.quadratic.coefficients[0][4] += 0.01;  // det J varies by 40 % through the body
    const double each = mapped_volumes_ml(volume, registration)[1];
    EXPECT_NEAR(mapped_volumes_ml(volume, registration, 0)[1] / each, 1, 1e-4);
}

}  // namespace
}  // namespace sonocase::pipeline
