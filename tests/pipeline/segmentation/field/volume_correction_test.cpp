// SPDX-License-Identifier: Apache-2.0

#include "pipeline/segmentation/volume_correction.h"

#include <gtest/gtest.h>

#include <cmath>

#include "support/shapes.h"

namespace sonocase::pipeline {
namespace {

using sonocase::testing::cubic_grid;
using sonocase::testing::norm_of;
using sonocase::testing::sample_labels;

// Cells are weighted block by block. The deficit that all labels seem to share under a weight that
// varies inside the blocks must not drive their offsets to the limit, where none is kept.
TEST(VolumeCorrection, KeepVolumesWhereTheWeightVaries) {
    const LabelVolume ct = sample_labels(cubic_grid(48), 4, [](Point3 p) {
        if (norm(p - Point3{-9, 4, 0}) < 5) return 2;
        if (norm(p - Point3{9, 0, -6}) < 2) return 3;
        return norm_of(p) < 19 ? 1 : 0;
    });
    LabelField field(ct, {});
    const VolumeCorrectionReport report =
        correct_volumes(&field, [](Point3 p) { return 1 + 0.8 * std::cos(0.785398 * (p.x + 20)); });
    EXPECT_LT(report.largest_error, 0.01);
    for (std::size_t l = 0; l < 4; ++l) {
        EXPECT_NEAR(report.reached_mm3[l] / report.target_mm3[l], 1, 0.01) << l;
        EXPECT_LT(std::abs(field.volume_offsets_mm()[l]), 0.6) << l;  // the limit is 1.5
    }
}

// One node in four gives the offsets that all of them give, flat faces across the axes included,
// and small labels keep all of theirs.
TEST(VolumeCorrection, OneNodeInFourGivesTheSameOffsets) {
    const LabelVolume ct = sample_labels(cubic_grid(96), 5, [](Point3 p) {
        if (norm(p - Point3{-9, 4, 0}) < 25) return 2;
        if (norm(p - Point3{35, 0, -6}) < 2) return 3;
        if (p.z < -20) return 4;
        return norm_of(p) < 45 ? 1 : 0;
    });
    LabelField all(ct, {}), some(ct, {});
    VolumeCorrectionOptions options;
    const auto weight = [](Point3 p) { return 1 + 0.2 * std::cos(0.05 * p.x); };
    const VolumeCorrectionReport expected = correct_volumes(&all, weight, options);
    options.max_read_nodes = 0;
    const VolumeCorrectionReport report = correct_volumes(&some, weight, options);
    for (std::size_t l = 0; l < 5; ++l) {
        EXPECT_DOUBLE_EQ(report.target_mm3[l], expected.target_mm3[l]) << l;
        EXPECT_NEAR(report.reached_mm3[l] / expected.reached_mm3[l], 1, 0.002) << l;
        EXPECT_NEAR(some.volume_offsets_mm()[l], all.volume_offsets_mm()[l], 0.02) << l;
    }
}

}  // namespace
}  // namespace sonocase::pipeline
