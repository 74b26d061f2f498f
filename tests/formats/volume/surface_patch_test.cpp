// SPDX-License-Identifier: Apache-2.0

#include "formats/volume/surface_patch.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "formats/volume/boundary_record.h"
#include "support/random.h"

namespace sonocase {
namespace {

using testing::Random;

constexpr int kReach = 72;  // 1.5 voxels

// A surface by its signed distance (>= 0: label 1, else label 2) and that distance's gradient, at
// voxels -1.5 to 1.5 from the brick's centre.
struct Brick {
    BrickLabels labels;
    BrickRecords records;
};

template <class Distance, class Normal>
Brick brick_of(const Distance& distance, const Normal& normal) {
    Brick out;
    for (std::size_t v = 0; v < kBrickVoxels; ++v) {
        const Point3 p{static_cast<double>(v % 4) - 1.5, static_cast<double>(v / 4 % 4) - 1.5,
                       static_cast<double>(v / 16) - 1.5};
        const double d = distance(p);
        out.labels[v] = d >= 0 ? 1 : 2;
        const Vector3 n = d >= 0 ? normal(p) : -normal(p);
        const auto second = static_cast<std::uint8_t>(d >= 0 ? 2 : 1);
        out.records[v] = std::abs(d) <= kReach / kBoundaryStepsPerVoxel
                             ? pack_boundary({second, std::abs(d), n})
                             : kNoBoundary;
    }
    return out;
}

struct Worst {
    double distance_vx = 0, normal_deg = 0;
    int records = 0;
};

// Labels and records that the fit gives back, against those of the brick.
Worst worst_of(const Brick& brick) {
    Worst worst;
    const std::vector<SurfacePatch> patches = fit_patches(brick.labels, brick.records);
    EXPECT_EQ(patches.size(), 1u);
    if (patches.size() != 1) return worst;
    Brick back;
    labels_from_patch(patches[0], back.labels.data());
    records_from_patches(patches, back.labels.data(), kReach, back.records.data());
    for (std::size_t v = 0; v < kBrickVoxels; ++v) {
        if (brick.records[v] == kNoBoundary || back.records[v] == kNoBoundary) continue;
        BoundaryRecord a = unpack_boundary(brick.records[v]), b = unpack_boundary(back.records[v]);
        const double side = brick.labels[v] == back.labels[v] ? 1 : -1;
        worst.distance_vx =
            std::max(worst.distance_vx, std::abs(a.distance_vx - side * b.distance_vx));
        worst.normal_deg =
            std::max(worst.normal_deg,
                     57.2958 * std::acos(std::clamp(side * dot(a.normal, b.normal), -1.0, 1.0)));
        ++worst.records;
    }
    return worst;
}

TEST(SurfacePatch, PlanesComeBackToTheStepOfTheRecords) {
    const std::uint64_t seed = 21;
    SCOPED_TRACE(seed);
    Random random(seed);
    for (int n = 0; n < 300; ++n) {
        const Vector3 normal = random.direction();
        const double offset = random.uniform(-1.5, 1.5);
        const Brick brick = brick_of([&](Point3 p) { return dot(p - Point3{}, normal) + offset; },
                                     [&](Point3) { return normal; });
        const Worst worst = worst_of(brick);
        EXPECT_GT(worst.records, 0);
        // Half a step of the records and of each coefficient: 1/96 + 1/64 + 3 * 1.5 / 128, at
        // worst.
        EXPECT_LT(worst.distance_vx, 0.07) << n;
        EXPECT_LT(worst.normal_deg, 2.0) << n;  // twice what the octahedron rounds
    }
}

TEST(SurfacePatch, BallsOfEightVoxelsDo) {
    const std::uint64_t seed = 22;
    SCOPED_TRACE(seed);
    Random random(seed);
    for (int n = 0; n < 200; ++n) {
        const Point3 centre = Point3{} + random.uniform(6.8, 9.2) * random.direction();
        const Brick brick = brick_of([&](Point3 p) { return 8 - norm(p - centre); },
                                     [&](Point3 p) { return normalized(centre - p); });
        const Worst worst = worst_of(brick);
        // What is left out is of third order: (2.6 vx)^3 / (6 R^2), a few hundredths of a voxel and
        // degrees.
        EXPECT_LT(worst.distance_vx, 0.07) << n;
        EXPECT_LT(worst.normal_deg, 5) << n;
    }
}

TEST(SurfacePatch, ContinuedIsTheSameSurfaceInTheNextBrick) {
    const std::uint64_t seed = 24;
    SCOPED_TRACE(seed);
    Random random(seed);
    for (int axis = 0; axis < 3; ++axis) {
        SurfacePatch patch{1, 2, {}};
        for (auto& c : patch.c) c = static_cast<std::int16_t>(random.uniform(-60, 60));
        const SurfacePatch next = continued(patch, axis);
        // Two voxels of the next brick's first half are beyond this one's: extend by hand.
        const auto value = [](const SurfacePatch& p, Vector3 u) {
            return p.c[0] / 32.0 + (p.c[1] * u.x + p.c[2] * u.y + p.c[3] * u.z) / 64.0 +
                   (p.c[4] * u.x * u.x + p.c[5] * u.y * u.y + p.c[6] * u.z * u.z +
                    p.c[7] * u.x * u.y + p.c[8] * u.x * u.z + p.c[9] * u.y * u.z) /
                       128.0;
        };
        for (int n = 0; n < 20; ++n) {
            const Vector3 u{random.uniform(-2, 2), random.uniform(-2, 2), random.uniform(-2, 2)};
            Vector3 before = u;
            before[axis] += 4;
            EXPECT_NEAR(value(next, u), value(patch, before), 1e-12);
        }
    }
}

TEST(SurfacePatch, TheNearerOfTwoSurfacesIsRecorded) {
    // A layer of label 2, two voxels thick, between 1 and 3.
    Brick brick;
    for (std::size_t v = 0; v < kBrickVoxels; ++v) {
        const double z = static_cast<double>(v / 16) - 1.5;
        brick.labels[v] = static_cast<std::uint8_t>(z < -1 ? 1 : z < 1 ? 2 : 3);
        const bool lower = z < 0;
        const double d = lower ? z + 1 : z - 1;
        const bool in_layer = brick.labels[v] == 2;
        const auto second = static_cast<std::uint8_t>(in_layer ? (lower ? 1 : 3) : 2);
        const Vector3 up{0, 0, 1};
        brick.records[v] = pack_boundary({second, std::abs(d), d >= 0 ? up : -up});
    }
    const auto patches = fit_patches(brick.labels, brick.records);
    ASSERT_EQ(patches.size(), 2u);
    BrickRecords back;
    records_from_patches(patches, brick.labels.data(), kReach, back.data());
    EXPECT_EQ(back, brick.records);
}

TEST(SurfacePatch, NonsenseIsSurvived) {
    BrickLabels labels;
    BrickRecords records;
    labels.fill(1);
    records.fill(pack_boundary({1, 0.5, {0, 0, 1}}));  // a label parted from itself
    EXPECT_TRUE(fit_patches(labels, records).empty());
    records.fill(kNoBoundary);
    EXPECT_TRUE(fit_patches(labels, records).empty());
    SurfacePatch wild{0, 1, {}};
    wild.c.fill(-32768);
    labels_from_patch(wild, labels.data());
    records_from_patches({&wild, 1}, labels.data(), 127, records.data());
    for (const std::uint32_t r : records) EXPECT_TRUE(r == kNoBoundary || (r & 0xFFu) <= 1);
    EXPECT_EQ(continued(wild, 2).low, 0);
}

}  // namespace
}  // namespace sonocase
