// SPDX-License-Identifier: Apache-2.0

// The worked stage of docs/extending.md.
#include "documents/examples/crop_labels.h"

#include <gtest/gtest.h>

#include "support/shapes.h"

namespace sonocase::pipeline {
namespace {

LabelVolume ball(double radius_mm) {
    return testing::sample_labels(testing::cubic_grid(41), 2, [&](Point3 p) {
        return testing::norm_of(p) <= radius_mm ? 1 : 0;
    });
}

TEST(CropLabels, KeepsTheBallTheMarginAndThePlaceOfEveryVoxel) {
    const LabelVolume whole = ball(10);
    const auto cropped = crop_labels(whole, {.margin_mm = 3});
    ASSERT_TRUE(cropped);
    EXPECT_EQ(cropped->volume.grid.size, (Int3{27, 27, 27}));  // 10 + 1 + 10 and 3 on each side
    EXPECT_EQ(cropped->volume.grid.point_from_voxel({13, 13, 13}), Point3{});
    EXPECT_EQ(testing::count_label(cropped->volume, 1), testing::count_label(whole, 1));
    EXPECT_TRUE(cropped->report.warnings.empty());
}

TEST(CropLabels, SaysThatABodyWasCutAndRefusesNone) {
    const auto cut = crop_labels(ball(30));
    ASSERT_TRUE(cut);
    EXPECT_EQ(cut->report.warnings.size(), 1u);
    EXPECT_EQ(cut->volume.grid.size, (Int3{41, 41, 41}));
    const auto nothing = crop_labels(ball(-1));
    ASSERT_FALSE(nothing);
    EXPECT_NE(nothing.error().message().find("expected a body"), std::string::npos);
}

}  // namespace
}  // namespace sonocase::pipeline
