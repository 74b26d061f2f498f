// SPDX-License-Identifier: Apache-2.0

// Distance transform against brute force, limits and damage of the level set, volumes kept by the
// joint smoothing.
#include <gtest/gtest.h>

#include <cmath>

#include "numerics/property.h"
#include "pipeline/segmentation/distance/signed_distance.h"
#include "pipeline/segmentation/level_set_smoothing.h"
#include "pipeline/segmentation/smooth_labels.h"
#include "support/hard_case.h"

namespace sonocase::numerics {
namespace {

using testing::HardCase;

LabelVolume blank(Int3 size, Vector3 spacing_mm) {
    LabelVolume v;
    v.grid.size = size;
    v.grid.spacing_mm = spacing_mm;
    v.voxels.assign(v.grid.voxel_count(), 0);
    v.labels = {{"outside", "outside", 0, {0, 0, 0}},
                {"one", "liver", 1, {1, 1, 1}},
                {"two", "fat", 2, {2, 2, 2}}};
    return v;
}

// Exact distance between voxel centres, less half a voxel, as the header says; along i alone where
// a plane separates the two.
double brute_force(const LabelVolume& v, std::uint8_t label, Int3 at, double limit) {
    const bool own = v.voxels[v.grid.index(at.x, at.y, at.z)] == label;
    double best = INFINITY;
    for (int k = 0; k < v.grid.size.z; ++k) {
        for (int j = 0; j < v.grid.size.y; ++j) {
            for (int i = 0; i < v.grid.size.x; ++i) {
                if ((v.voxels[v.grid.index(i, j, k)] == label) == own) continue;
                best = std::min(best, std::hypot(v.grid.spacing_mm.x * (i - at.x),
                                                 v.grid.spacing_mm.y * (j - at.y),
                                                 v.grid.spacing_mm.z * (k - at.z)));
            }
        }
    }
    return (own ? -1 : 1) * std::min(best, 10 * limit);
}

// How far distances are off brute force, over the limit; infinite where a sign is wrong.
double distance_off(testing::Random random) {
    const double h = std::pow(10.0, random.uniform(-1, 1));
    LabelVolume v = blank({9, 8, 7}, {h, h, h});
    for (auto& voxel : v.voxels) voxel = random.uniform(0, 1) < 0.3;
    v.voxels[0] = 0;
    v.voxels[1] = 1;
    const double limit = 20 * h;
    std::vector<float> phi;
    const pipeline::VoxelBox all{{0, 0, 0}, v.grid.size};
    pipeline::signed_distance(v, 1, all, limit, {true, true, true}, &phi);
    double worst = 0;
    for (int k = 0; k < 7; ++k) {
        for (int j = 0; j < 8; ++j) {
            for (int i = 0; i < 9; ++i) {
                const double d = phi[v.grid.index(i, j, k)],
                             truth = brute_force(v, 1, {i, j, k}, limit);
                if ((d < 0) != (truth < 0)) return INFINITY;
                worst =
                    std::max(worst, std::abs(std::abs(d) - (std::abs(truth) - 0.5 * h)) / limit);
            }
        }
    }
    return worst;
}

RC_GTEST_PROP(DistanceNumerics, SignIsTheLabelAndTheSizeThatOfBruteForce, ()) {
    RC_ASSERT(distance_off(random_case()) <= 1e-5);
}

TEST(DistanceNumerics, OfFiftyVolumesIsThatOfBruteForce) {
    HardCase off("distance off brute force, of its limit, 50 volumes", HardCase::at_most, 1e-5, "");
    for (std::uint64_t seed = 1; seed <= 50; ++seed) off.see(distance_off(testing::Random(seed)));
}

TEST(DistanceNumerics, NoneAllAndOneVoxel) {
    LabelVolume v = blank({5, 5, 5}, {1, 1, 1});
    std::vector<float> phi;
    const pipeline::VoxelBox all{{0, 0, 0}, v.grid.size};
    pipeline::signed_distance(v, 1, all, 4, {true, true, true}, &phi);
    for (float d : phi) EXPECT_FLOAT_EQ(d, 4);
    v.voxels[v.grid.index(2, 2, 2)] = 1;
    pipeline::signed_distance(v, 1, all, 4, {true, true, true}, &phi);
    EXPECT_FLOAT_EQ(phi[v.grid.index(2, 2, 2)], -0.5f);
    EXPECT_FLOAT_EQ(phi[v.grid.index(3, 2, 2)], 0.5f);
    EXPECT_NEAR(phi[v.grid.index(0, 0, 0)], std::sqrt(12.0) - 0.5, 1e-5);
    v.voxels.assign(v.voxels.size(), 1);
    pipeline::signed_distance(v, 1, all, 4, {true, true, true}, &phi);
    for (float d : phi) EXPECT_FLOAT_EQ(d, -4);
}

TEST(LevelSetNumerics, StepAboveTheLimitIsRefused) {
    LabelVolume v = blank({12, 12, 12}, {1, 1, 1});
    v.voxels[v.grid.index(6, 6, 6)] = 1;
    const double limit = pipeline::max_stable_step(0.3, 1);
    EXPECT_NEAR(limit, 2 / (0.3 + 8), 1e-12);
    pipeline::LevelSetOptions options;
    options.time_step = 1.01 * limit;
    EXPECT_FALSE(pipeline::level_set_smoothing(v, options));
    double taken = 0.5, refused = 2;
    while (refused - taken > 1e-4) {
        options.time_step = 0.5 * (taken + refused) * limit;
        (pipeline::level_set_smoothing(v, options) ? taken : refused) = options.time_step / limit;
    }
    HardCase largest("largest step taken, over the limit", HardCase::at_most, 1.0001, "");
    largest.see(taken);
    options.time_step = 0.99 * limit;
    EXPECT_TRUE(pipeline::level_set_smoothing(v, options));
}

TEST(LevelSetNumerics, BallBelowTheCriticalRadiusVanishesAndIsReported) {
    // A sphere survives only if R >= sqrt(8 / K0): 8.9 mm here.
    for (double radius : {5.0, 12.0}) {
        LabelVolume v = blank({32, 32, 32}, {1, 1, 1});
        long count = 0;
        for (int k = 0; k < 32; ++k) {
            for (int j = 0; j < 32; ++j) {
                for (int i = 0; i < 32; ++i) {
                    const bool in = std::hypot(i - 15.5, j - 15.5, k - 15.5) < radius;
                    v.voxels[v.grid.index(i, j, k)] = in;
                    count += in;
                }
            }
        }
        pipeline::LevelSetOptions options;
        options.k0 = 0.1;
        options.iterations = 200;
        const auto out = pipeline::level_set_smoothing(v, options);
        ASSERT_TRUE(out);
        long left = 0;
        for (auto voxel : out->volume.voxels) left += voxel == 1;
        if (radius < 8) {
            EXPECT_LT(static_cast<double>(left), 0.2 * static_cast<double>(count));
            EXPECT_FALSE(out->report.warnings.empty());
        } else {
            EXPECT_GT(static_cast<double>(left), 0.5 * static_cast<double>(count));
        }
    }
}

LabelVolume blobs(testing::Random& random) {
    LabelVolume v = blank({40, 36, 32}, {1, 1, 1});
    const Point3 a{random.uniform(12, 18), 17, 15}, b{random.uniform(22, 28), 19, 17};
    for (int k = 0; k < 32; ++k) {
        for (int j = 0; j < 36; ++j) {
            for (int i = 0; i < 40; ++i) {
                const double da = std::hypot(i - a.x, j - a.y, k - a.z),
                             db = std::hypot(i - b.x, j - b.y, k - b.z);
                v.voxels[v.grid.index(i, j, k)] = da < 9 && da <= db ? 1 : db < 7 ? 2 : 0;
            }
        }
    }
    return v;
}

TEST(JointSmoothingNumerics, VolumesAreKeptAndNothingIsLost) {
    HardCase change("change of a label's volume, joint smoothing", HardCase::at_most, 0.02, "");
    testing::Random random(2);
    for (int draw = 0; draw < 4; ++draw) {
        const LabelVolume v = blobs(random);
        const auto out = pipeline::smooth_labels(v);
        ASSERT_TRUE(out);
        std::array<double, 3> before{}, after{};
        for (auto voxel : v.voxels) before[voxel] += 1;
        for (auto voxel : out->volume.voxels) after[voxel] += 1;
        for (std::size_t label = 1; label < 3; ++label)
            change.see(std::abs(after[label] / before[label] - 1));
    }
}

TEST(JointSmoothingNumerics, MirroredInputGivesTheMirroredAnswer) {
    testing::Random random(3);
    const LabelVolume v = blobs(random);
    LabelVolume mirrored = v;
    for (int k = 0; k < 32; ++k) {
        for (int j = 0; j < 36; ++j) {
            for (int i = 0; i < 40; ++i) {
                mirrored.voxels[v.grid.index(39 - i, j, k)] = v.voxels[v.grid.index(i, j, k)];
            }
        }
    }
    const auto a = pipeline::smooth_labels(v), b = pipeline::smooth_labels(mirrored);
    ASSERT_TRUE(a && b);
    long differ = 0;
    for (int k = 0; k < 32; ++k) {
        for (int j = 0; j < 36; ++j) {
            for (int i = 0; i < 40; ++i) {
                differ += a->volume.voxels[v.grid.index(i, j, k)] !=
                          b->volume.voxels[v.grid.index(39 - i, j, k)];
            }
        }
    }
    // Blocks start at one corner, so ties between labels may be decided differently.
    HardCase ties("of 46,080 voxels, other than in the mirror", HardCase::at_most, 40, "");
    ties.see(static_cast<double>(differ));
}

}  // namespace
}  // namespace sonocase::numerics
