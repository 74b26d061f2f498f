// SPDX-License-Identifier: Apache-2.0

// Distances made and dropped layer by layer give the same as distances that are kept, bit for bit.
#include <gtest/gtest.h>

#include <cmath>

#include "pipeline/segmentation/label_field.h"
#include "pipeline/segmentation/sampled_field.h"
#include "pipeline/segmentation/volume_correction.h"
#include "support/hard_case.h"
#include "support/random.h"

namespace sonocase::pipeline {
namespace {

using sonocase::testing::Random;

// A body 300 slices long: three layers of blocks. A vessel winds through all of it, balls lie on
// the borders of layers at slices 128 and 256, and one voxel with its own label is lost by
// sampling.
LabelVolume long_body() {
    LabelVolume ct;
    ct.grid.size = {40, 36, 300};
    ct.grid.spacing_mm = {1, 1, 1};
    ct.labels.resize(7);
    for (std::size_t l = 0; l < ct.labels.size(); ++l) ct.labels[l].name = std::to_string(l);
    for (int k = 0; k < ct.grid.size.z; ++k) {
        for (int j = 0; j < ct.grid.size.y; ++j) {
            for (int i = 0; i < ct.grid.size.x; ++i) {
                const double x = i - 19.5, y = j - 17.5, off = 7 * std::sin(0.04 * k);
                int label = std::hypot(x / 17, y / 15) < 1 ? 1 : 0;
                if (std::hypot(x / 14, y / 12) < 1) label = 2;
                if (std::hypot(x - off, y) < 3) label = 3;
                if (std::hypot(x + 5, y - 4, k - 128) < 5) label = 4;
                if (std::hypot(x - 4, y + 4, k - 256) < 5) label = 5;
                if (i == 11 && j == 12 && k == 190) label = 6;
                ct.voxels.push_back(static_cast<std::uint8_t>(label));
            }
        }
    }
    return ct;
}

struct Sampled {
    std::vector<float> offsets;
    SampledField field;
};

// Into a grid turned by `turn_rad` about x, such that its rows of bricks cross the layers.
Sampled sample(const LabelVolume& ct,
               std::size_t held_mb,
               double turn_rad,
               std::size_t max_float_nodes = LabelFieldOptions{}.max_float_nodes) {
    LabelFieldOptions options;
    options.held_mb = held_mb;
    options.max_float_nodes = max_float_nodes;
    LabelField field(ct, options);
    EXPECT_EQ(field.layer_count(), 3);
    EXPECT_EQ(field.holds_all(), held_mb > 0);
    Sampled out;
    correct_volumes(&field, [](Point3) { return 1.0; });
    out.offsets = field.volume_offsets_mm();
    Grid grid;
    grid.size = {20, 60, 160};
    grid.spacing_mm = {2, 2, 2};
    const double c = std::cos(turn_rad), s = std::sin(turn_rad);
    Matrix3 turn;  // the identity
    turn(1, 1) = turn(2, 2) = c;
    turn(1, 2) = -s;
    turn(2, 1) = s;
    FieldMap map;
    map.row = [&](int j, int k, float* x, float* y, float* z, MapStatus* status) {
        for (int i = 0; i < grid.size.x; ++i) {
            const Vector3 at = turn * Vector3{0, 2.0 * j - 60, 2.0 * k - 160};
            x[i] = static_cast<float>(2 * i);
            y[i] = static_cast<float>(at.y + 18);
            z[i] = static_cast<float>(at.z + 150);
            status[i] = MapStatus::ok;
        }
    };
    map.jacobian = [&](Point3) { return turn; };
    map.forward = [&](Point3 p) {
        const Vector3 v{0, p.y - 18, p.z - 150};
        return Point3{p.x, c * v.y + s * v.z + 60, -s * v.y + c * v.z + 160};
    };
    out.field = sample_label_field(&field, grid, map, {1.5});
    return out;
}

TEST(LabelLayers, GiveTheSameBytesAsAllDistancesAtOnce) {
    const LabelVolume ct = long_body();
    for (const double turn_rad : {0.0, 0.3, 1.2}) {
        const Sampled whole = sample(ct, LabelFieldOptions::kAll, turn_rad);
        const Sampled streamed = sample(ct, 0, turn_rad);
        EXPECT_EQ(streamed.offsets, whole.offsets);
        EXPECT_EQ(streamed.field.volume.voxels, whole.field.volume.voxels);
        EXPECT_EQ(streamed.field.boundary.table, whole.field.boundary.table);
        EXPECT_EQ(streamed.field.boundary.pool, whole.field.boundary.pool);
        EXPECT_EQ(streamed.field.counts.outside, whole.field.counts.outside);
        EXPECT_EQ(streamed.field.rescued, whole.field.rescued);
        EXPECT_EQ(streamed.field.lost, whole.field.lost);
        EXPECT_GT(whole.field.boundary.pool.size(), 10000u);
    }
}

// 16-bit numbers give the same whatever the layers, and nearly the same as floats.
TEST(LabelLayers, HalvedNumbersGiveTheSameSurfaces) {
    const LabelVolume ct = long_body();
    const Sampled floats = sample(ct, LabelFieldOptions::kAll, 0.3);
    const Sampled whole = sample(ct, LabelFieldOptions::kAll, 0.3, 0);
    const Sampled streamed = sample(ct, 0, 0.3, 0);
    EXPECT_EQ(streamed.offsets, whole.offsets);
    EXPECT_EQ(streamed.field.volume.voxels, whole.field.volume.voxels);
    EXPECT_EQ(streamed.field.boundary.pool, whole.field.boundary.pool);
    for (std::size_t l = 0; l < floats.offsets.size(); ++l)
        EXPECT_NEAR(whole.offsets[l], floats.offsets[l], 1e-3) << l;
    std::size_t voxels = 0;
    for (std::size_t v = 0; v < floats.field.volume.voxels.size(); ++v)
        voxels += floats.field.volume.voxels[v] != whole.field.volume.voxels[v];
    testing::HardCase other("of 192,000 voxels, other with 16-bit numbers",
                            testing::HardCase::at_most, 5, "");
    other.see(static_cast<double>(voxels));
    EXPECT_EQ(whole.field.boundary.table, floats.field.boundary.table);
    EXPECT_EQ(whole.field.rescued, floats.field.rescued);
}

TEST(LabelLayers, GoWhereThereIsNoRoomAndComeBackTheSame) {
    const LabelVolume ct = long_body();
    LabelFieldOptions options;
    LabelField whole(ct, options);
    options.held_mb = 0;
    LabelField field(ct, options);
    EXPECT_TRUE(field.holds(0));
    EXPECT_FALSE(field.holds(1) || field.holds(2));
    whole.find_candidates(2);
    field.find_candidates(2);
    for (const int first : {1, 0, 1}) {
        field.hold(first, first + 1);
        EXPECT_TRUE(field.holds(first) && field.holds(first + 1));
        EXPECT_FALSE(field.holds(first == 0 ? 2 : 0));
        Random random(static_cast<std::uint64_t>(first) + 1);
        for (int n = 0; n < 2000; ++n) {
            const auto x = static_cast<float>(random.uniform(0, 39)),
                       y = static_cast<float>(random.uniform(0, 35)),
                       z = static_cast<float>(
                           random.uniform(128.0 * first, std::min(299.0, 128.0 * first + 255)));
            const auto at = field.locate(x, y, z), there = whole.locate(x, y, z);
            ASSERT_EQ(at.candidates == nullptr, there.candidates == nullptr);
            if (at.candidates == nullptr) continue;
            ASSERT_EQ(at.candidates->labels, there.candidates->labels);
            std::array<float, 256> score, other;
            field.scores(at, score.data());
            whole.scores(there, other.data());
            for (std::size_t l = 0; l < at.candidates->labels.size(); ++l)
                ASSERT_EQ(score[l], other[l]);
        }
    }
}

}  // namespace
}  // namespace sonocase::pipeline
