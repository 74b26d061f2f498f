// SPDX-License-Identifier: Apache-2.0

// Resampling by shape: known solids through known maps.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "formats/volume/boundary_record.h"
#include "pipeline/base/parallel.h"
#include "pipeline/segmentation/known_maps.h"
#include "pipeline/segmentation/resample_labels.h"
#include "pipeline/segmentation/smooth_labels.h"
#include "support/random.h"
#include "support/shapes.h"

namespace sonocase::pipeline {
namespace {

using namespace sonocase::testing;  // shapes and maps of known answer

double percentile(std::vector<double> values, double part) {
    std::sort(values.begin(), values.end());
    return values[static_cast<std::size_t>(part * static_cast<double>(values.size() - 1))];
}

// Errors of all boundary records against an exact signed distance (negative inside label 1).
struct RecordErrors {
    std::vector<double> distance_mm, normal_deg;
};

template <class Distance>
RecordErrors record_errors(const LabelVolume& volume,
                           const BrickVolume<std::uint32_t>& boundary,
                           const Rigid& motion,
                           const Distance& distance) {
    RecordErrors errors;
    const Grid& g = volume.grid;
    const Rigid back = inverse(motion);
    for (int k = 0; k < g.size.z; ++k) {
        for (int j = 0; j < g.size.y; ++j) {
            for (int i = 0; i < g.size.x; ++i) {
                const std::uint32_t packed = boundary.at(i, j, k);
                if (packed == kNoBoundary) continue;
                const BoundaryRecord record = unpack_boundary(packed);
                const Point3 p =
                    back * g.point_from_voxel({static_cast<double>(i), static_cast<double>(j),
                                               static_cast<double>(k)});
                const bool in = volume.voxels[g.index(i, j, k)] == 1;
                const double d = distance(p);
                const double e = 1e-4;
                const Vector3 out{
                    (distance(Point3{p.x + e, p.y, p.z}) - distance(Point3{p.x - e, p.y, p.z})),
                    (distance(Point3{p.x, p.y + e, p.z}) - distance(Point3{p.x, p.y - e, p.z})),
                    (distance(Point3{p.x, p.y, p.z + e}) - distance(Point3{p.x, p.y, p.z - e}))};
                const Vector3 own = motion * normalized(in ? -out : out);
                errors.distance_mm.push_back(
                    std::abs(record.distance_vx * g.spacing_mm.x - (in ? -d : d)));
                errors.normal_deg.push_back(
                    57.29577951 * std::acos(std::clamp(dot(own, record.normal), -1.0, 1.0)));
            }
        }
    }
    return errors;
}

TEST(ShapeResampling, BoundaryPlanesOfATurnedSphereAreExact) {
    const std::uint64_t seed = 5;
    SCOPED_TRACE(seed);
    Random random(seed);
    const double radius = 15;
    const auto distance = [&](Point3 p) { return norm_of(p) - radius; };
    const LabelVolume ct =
        sample_labels(cubic_grid(44), 2, [&](Point3 p) { return distance(p) < 0 ? 1 : 0; });
    const Rigid motion = random.rigid(50);
    const auto result = resample_labels({ct, rigid_registration(motion, ct.grid)});
    ASSERT_TRUE(result);
    const RecordErrors errors = record_errors(result->volume, result->boundary, motion, distance);
    ASSERT_GT(errors.distance_mm.size(), 4000u);  // 4 pi r^2 times 3 mm is 8482
    // The targets for organs; most of the error is at the six facets that voxels leave on a sphere.
    EXPECT_LT(percentile(errors.distance_mm, 0.95), 0.15);
    EXPECT_LT(percentile(errors.normal_deg, 0.95), 8.0);
    // Compared with the voxels of the map; counting voxels on another grid adds 0.3 %.
    EXPECT_NEAR(result->changes.at(0).change(), 0, 0.01);
}

TEST(ShapeResampling, TubeOfTwoMillimetresKeepsVolumeAndPlanes) {
    const Vector3 axis = normalized({1, 0.7, 0.4});
    const auto distance = [&](Point3 p) { return norm(cross(p - Point3{}, axis)) - 2.0; };
    const LabelVolume ct =
        sample_labels(cubic_grid(40), 2, [&](Point3 p) { return distance(p) < 0 ? 1 : 0; });
    const auto result = resample_labels({ct, rigid_registration({}, ct.grid)});
    ASSERT_TRUE(result);
    const double kept = result->changes.at(0).change();
    EXPECT_NEAR(kept, 0, 0.05);
    const RecordErrors errors = record_errors(result->volume, result->boundary, {}, distance);
    EXPECT_LT(percentile(errors.distance_mm, 0.95), 0.3);
}

// 45 degrees through slices of 5 mm: the outlines of r = 2 mm do not overlap from slice to slice.
TEST(ShapeResampling, ObliqueVesselStaysOnePieceThroughThickSlices) {
    const Vector3 axis = normalized({1, 0, 0.8});
    const auto inside = [&](Point3 p) { return norm(cross(p - Point3{}, axis)) < 2.0; };
    const LabelVolume ct =
        sample_labels(thick_grid(60, 5), 3, [&](Point3 p) { return inside(p) ? 1 : 2; });
    const auto result = resample_labels({ct, rigid_registration({}, ct.grid)});
    ASSERT_TRUE(result);
    const Grid& g = result->volume.grid;
    for (double along = -20; along <= 20; along += 0.5) {
        const Point3 p = g.voxel_from_point(Point3{} + along * axis);
        const int label = result->volume.voxels[g.index(static_cast<int>(std::lround(p.x)),
                                                        static_cast<int>(std::lround(p.y)),
                                                        static_cast<int>(std::lround(p.z)))];
        EXPECT_EQ(label, 1) << "the vessel is cut " << along << " mm along";
    }
    EXPECT_NEAR(result->changes.at(0).change(), 0, 0.05);
}

// A fit may be proven on a box larger than the map, but nothing is known beyond the map's voxels.
TEST(ShapeResampling, NothingIsReadBeyondTheMap) {
    for (const double slice_mm : {2.0, 5.0}) {
        SCOPED_TRACE(slice_mm);
        Grid grid = thick_grid(40, slice_mm);
        const LabelVolume ct =
            sample_labels(grid, 3, [](Point3 p) { return std::abs(p.x) < 12 ? 1 : 2; });
        Registration registration = rigid_registration({{}, {0.4, 0.3, 0.2}}, grid);
        for (int a = 0; a < 3; ++a) {
            registration.ct_box.lower[a] -= 8;
            registration.ct_box.upper[a] += 8;
        }
        const auto result = resample_labels({ct, registration});
        ASSERT_TRUE(result);
        for (const LabelChange& c : result->changes) EXPECT_NEAR(c.change(), 0, 0.01) << c.label;
    }
}

TEST(ShapeResampling, SlicesMayLieAlongAnyAxis) {
    const auto inside = [](Point3 p) { return norm_of(p) < 14 ? 1 : 0; };
    for (int axis = 0; axis < 3; ++axis) {
        SCOPED_TRACE(axis);
        Grid grid = cubic_grid(40);
        grid.spacing_mm[axis] = 4;
        grid.size[axis] = 10;
        grid.origin_mm[axis] = -18;
        const LabelVolume ct = sample_labels(grid, 2, inside);
        const auto result = resample_labels({ct, rigid_registration({}, grid)});
        ASSERT_TRUE(result);
        const LabelVolume truth = sample_labels(result->volume.grid, 2, inside);
        std::size_t wrong = 0;
        for (std::size_t v = 0; v < truth.voxels.size(); ++v) {
            wrong += truth.voxels[v] != result->volume.voxels[v];
        }
        // A shell of 0.13 mm: a thirtieth of the slice spacing.
        EXPECT_LT(static_cast<double>(wrong), 0.13 * 4 * 3.1416 * 14 * 14);
    }
}

TEST(ShapeResampling, ThinLabelsSurvive) {
    // A sheet of one voxel, a single voxel, one that touches the border, and a slab of one slice.
    const LabelVolume ct = sample_labels(cubic_grid(21), 6, [](Point3 p) {
        if (p.x == -10 && std::abs(p.y) < 3 && std::abs(p.z) < 3) return 4;
        if (p.z == 6) return 5;
        if (p.x == 3 && p.y == 3 && p.z == 0) return 3;
        if (p.y == 0) return 2;
        return 1;
    });
    const auto result = resample_labels({ct, rigid_registration({}, ct.grid)});
    ASSERT_TRUE(result);
    for (int label = 1; label <= 5; ++label) {
        EXPECT_GT(count_label(result->volume, label), 0u) << label;
    }
    // The sheet covers its plane without holes: off the other labels, each column meets it.
    const Grid& g = result->volume.grid;
    for (int x = -6; x <= 6; ++x) {
        bool met = false;
        for (int y = -1; y <= 1; ++y) {
            const Point3 v = g.voxel_from_point({static_cast<double>(x), y + 0.0, -5});
            met = met || result->volume.voxels[g.index(static_cast<int>(std::lround(v.x)),
                                                       static_cast<int>(std::lround(v.y)),
                                                       static_cast<int>(std::lround(v.z)))] == 2;
        }
        EXPECT_TRUE(met) << x;
    }
}

// A skin of one voxel around a ball: the default smoothing must neither thin nor pierce it.
TEST(ShapeResampling, SkinOfOneVoxelStaysWhole) {
    const LabelVolume ct = sample_labels(cubic_grid(54), 3, [](Point3 p) {
        const double r = norm_of(p);
        return r > 22 ? 0 : r > 21 ? 1 : 2;
    });
    const auto result = resample_labels({ct, rigid_registration({}, ct.grid)});
    ASSERT_TRUE(result);
    EXPECT_NEAR(result->changes.at(0).change(), 0, 0.2);
    const std::uint64_t seed = 7;
    SCOPED_TRACE(seed);
    Random random(seed);
    const Grid& g = result->volume.grid;
    int pierced = 0;
    for (int n = 0; n < 4000; ++n) {
        const Vector3 along = random.direction();
        bool met = false;
        for (double r = 18; r < 26 && !met; r += 0.1) {
            const Point3 v = g.voxel_from_point(Point3{} + r * along);
            met = result->volume.voxels[g.index(static_cast<int>(std::lround(v.x)),
                                                static_cast<int>(std::lround(v.y)),
                                                static_cast<int>(std::lround(v.z)))] == 1;
        }
        pierced += !met;
    }
    // Where voxels of the input itself meet only at edges, a straight line passes between them.
    EXPECT_LT(pierced, 80);
}

TEST(ShapeResampling, LabelSmallerThanAVoxelIsKeptAndNamed) {
    const LabelVolume ct = sample_labels(cubic_grid(24), 3, [](Point3 p) {
        return norm(p - Point3{1.5, 1.5, 1.5}) < 0.4 ? 2 : 1;
    });
    ResampleOptions options;
    options.voxel_mm = 5;
    const auto result = resample_labels({ct, rigid_registration({}, ct.grid)}, options);
    ASSERT_TRUE(result);
    EXPECT_GE(count_label(result->volume, 2), 1u);
    const LabelChange& change = result->changes.at(1);
    EXPECT_FALSE(change.lost());
    EXPECT_EQ(result->report.warnings.size(), 1u);  // 125 mm^3 where there was 1
    EXPECT_NE(result->report.warnings.at(0).find("label_2"), std::string::npos);
}

TEST(ShapeResampling, SameBytesForOneAndTwoThreads) {
    const LabelVolume ct = sample_labels(thick_grid(40, 4), 4, [](Point3 p) {
        return norm_of(p) > 17 ? 0 : p.x < 2 * p.z ? 1 : p.y < 0.3 * p.x ? 2 : 3;
    });
    Random random(9);
    const Registration registration = rigid_registration(random.rigid(30), ct.grid);
    std::vector<std::uint8_t> labels[2];
    RawVector<std::uint32_t> records[2];
    for (const int threads : {1, 2}) {
        const ThreadLimit limit(threads);
        const auto result = resample_labels({ct, registration});
        ASSERT_TRUE(result);
        labels[threads - 1] = result->volume.voxels;
        records[threads - 1] = result->boundary.pool;
    }
    EXPECT_EQ(labels[0], labels[1]);
    EXPECT_EQ(records[0], records[1]);
}

TEST(ShapeResampling, UnknownMethodIsRefused) {
    const LabelVolume ct = sample_labels(cubic_grid(4), 2, [](Point3) { return 1; });
    ResampleOptions options;
    options.method = "cubic";
    EXPECT_FALSE(resample_labels({ct, rigid_registration({}, ct.grid)}, options));
}

TEST(JointSmoothing, KeepsTheTubeThatLevelSetsRemove) {
    const LabelVolume volume = sample_labels(
        cubic_grid(32), 3, [](Point3 p) { return std::hypot(p.x - 0.3 * p.z, p.y) < 2 ? 1 : 2; });
    SmoothOptions options;
    const auto joint = smooth_labels(volume, options);
    ASSERT_TRUE(joint);
    EXPECT_NEAR(joint->changes.at(0).change(), 0, 0.05);
    EXPECT_EQ(count_label(joint->volume, 0), 0u);  // no gap
    EXPECT_FALSE(joint->boundary.pool.empty());
    options.method = "level_set";
    options.level_set.iterations = 200;
    const auto level_set = smooth_labels(volume, options);
    ASSERT_TRUE(level_set);
    EXPECT_LT(level_set->changes.at(0).change(), -0.9);
}

TEST(JointSmoothing, TakesTheStepsOutOfASlope) {
    // Blocks of 3 voxels make a staircase of a plane; its smooth form is the plane itself.
    const auto plane = [](Point3 p) { return 0.7071 * (p.x + p.z - 1.5); };
    const LabelVolume steps = sample_labels(cubic_grid(45), 3, [&](Point3 p) {
        const auto block = [](double v) { return 3 * std::round(v / 3); };
        return plane({block(p.x), p.y, block(p.z)}) < 0 ? 1 : 2;
    });
    const auto wrong = [&](const LabelVolume& volume) {
        std::size_t count = 0;
        for (int k = 8; k < 37; ++k) {
            for (int i = 8; i < 37; ++i) {
                const Point3 p = volume.grid.point_from_voxel(
                    {static_cast<double>(i), 22, static_cast<double>(k)});
                count += (volume.voxels[volume.grid.index(i, 22, k)] == 1) != (plane(p) < 0);
            }
        }
        return count;
    };
    SmoothOptions options;
    options.sigma_vx = 2;
    options.detail_vx = 2;
    const auto smooth = smooth_labels(steps, options);
    ASSERT_TRUE(smooth);
    EXPECT_LT(2 * wrong(smooth->volume), wrong(steps));
}

}  // namespace
}  // namespace sonocase::pipeline
