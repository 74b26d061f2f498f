// SPDX-License-Identifier: Apache-2.0

// A box of a case, cooked on smaller voxels: the same surfaces, nearer to the truth, and no change
// outside the box.
#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>

#include "formats/volume/boundary_record.h"
#include "pipeline/anatomy/analytic_torso.h"
#include "pipeline/base/parallel.h"
#include "pipeline/pathology/carry_into_region.h"
#include "pipeline/segmentation/resample_labels.h"
#include "pipeline/tradeoff/boundary_error.h"

namespace sonocase::pipeline {
namespace {

struct Torso {
    LabelVolume ct = sample_analytic_torso(analytic_torso_grid({3, 3, 3}));
    Registration map = analytic_torso_truth();
};

const Torso& torso() {
    static const Torso t;
    return t;
}

ResampleOptions options_with(const std::string& label, double voxel_mm) {
    ResampleOptions options;
    options.voxel_mm = 2;
    RegionRequest request;
    request.voxel_mm = voxel_mm;
    request.label = label;
    request.margin_mm = 4;
    options.region = request;
    return options;
}

LabelVolume volume_of(const FineRegion& region, const std::vector<Label>& labels) {
    return {region.grid, dense_from_bricks(region.label_bricks), labels};
}

TEST(CookedRegion, HasTheCasesSurfacesAndLeavesTheCaseAsItIs) {
    ResampleOptions options = options_with("gallbladder", 0.5);
    const auto with = resample_labels({torso().ct, torso().map}, options);
    ASSERT_TRUE(with) << with.error().message();
    ASSERT_TRUE(with->region);
    options.region.reset();
    const auto without = resample_labels({torso().ct, torso().map}, options);
    ASSERT_TRUE(without);
    EXPECT_EQ(with->volume.voxels, without->volume.voxels);
    EXPECT_EQ(dense_from_bricks<std::uint32_t>(with->boundary),
              dense_from_bricks<std::uint32_t>(without->boundary));

    const FineRegion& region = *with->region;
    EXPECT_TRUE(check_region(region, 2, "region"));
    const LabelVolume fine = volume_of(region, with->volume.labels);
    // Where both agree, and how far surfaces are apart; see measure_boundary_error().
    std::size_t points = 0, differ = 0, crossings = 0;
    constexpr double kStepMm = 0.37, kSegmentMm = 0.5;
    const Box3& box = region.box;
    for (double z = box.lower.z; z < box.upper.z; z += kStepMm) {
        for (double y = box.lower.y; y < box.upper.y; y += kStepMm) {
            for (double x = box.lower.x; x < box.upper.x; x += kStepMm) {
                const Point3 p{x, y, z};
                const int here = label_at_point(fine, region.boundary, p);
                const double s = kSegmentMm;
                const Vector3 along = points % 3 == 0   ? Vector3{s, 0, 0}
                                      : points % 3 == 1 ? Vector3{0, s, 0}
                                                        : Vector3{0, 0, s};
                ++points;
                crossings += label_at_point(fine, region.boundary, p + along) != here;
                differ += label_at_point(with->volume, with->boundary, p) != here;
            }
        }
    }
    const double apart_mm =
        static_cast<double>(differ) * kSegmentMm / (2.0 * static_cast<double>(crossings));
    std::printf("%zu points, surfaces %.3f mm apart on average\n", points, apart_mm);
    EXPECT_LT(apart_mm, 0.12);
    const auto error_of = [&](const LabelVolume& volume, const BoundaryBricks& boundary) {
        return measure_boundary_error(volume, boundary, torso().map, {}, 3000000, &box)
            .displaced_mm;
    };
    const double case_mm = error_of(with->volume, with->boundary),
                 region_mm = error_of(fine, region.boundary);
    std::printf("displaced %.3f mm in the case, %.3f mm in the region\n", case_mm, region_mm);
    EXPECT_LT(region_mm, case_mm + 0.01);
}

TEST(CookedRegion, SameBytesForAnyNumberOfThreads) {
    const ResampleOptions options = options_with("gallbladder", 0.6);
    std::vector<std::uint8_t> labels;
    std::vector<std::uint32_t> records;
    for (const int threads : {1, 2, 5}) {
        const ThreadLimit limit(threads);
        const auto made = resample_labels({torso().ct, torso().map}, options);
        ASSERT_TRUE(made && made->region);
        const auto l = dense_from_bricks(made->region->label_bricks);
        const auto r = dense_from_bricks<std::uint32_t>(made->region->boundary);
        if (labels.empty()) {
            labels = l;
            records = r;
        }
        EXPECT_EQ(l, labels) << threads;
        EXPECT_EQ(r, records) << threads;
    }
}

TEST(CookedRegion, RefusesWhatCannotBe) {
    const auto fault_of = [](const ResampleOptions& options) {
        const auto made = resample_labels({torso().ct, torso().map}, options);
        return made ? std::string() : made.error().message();
    };
    ResampleOptions options = options_with("no_such_label", 0.5);
    options.voxel_mm = 4;
    EXPECT_NE(fault_of(options).find("no label 'no_such_label'"), std::string::npos);
    options.region->label = "liver";
    options.region->voxel_mm = 4;
    EXPECT_NE(fault_of(options).find("voxels of 4 mm in a case of 4 mm"), std::string::npos);
    options.region->voxel_mm = 0.1;
    options.region->margin_mm = 50;
    EXPECT_NE(fault_of(options).find("million voxels"), std::string::npos);
    options.region->label.clear();
    options.region->centre = Point3{1e4, 0, 0};
    options.region->size_mm = {10, 10, 10};
    EXPECT_NE(fault_of(options).find("beyond the body"), std::string::npos);
    options.method = "nearest";
    EXPECT_NE(fault_of(options).find("cannot cook a region"), std::string::npos);
}

// A ball painted into the case's voxels shows in the region, with its surface, and nowhere else.
// Its planes of 2 mm lie outside the ball they touch: 2 % of its volume.
TEST(CookedRegion, LesionsAreCarriedOver) {
    const ResampleOptions options = options_with("gallbladder", 0.5);
    const auto made = resample_labels({torso().ct, torso().map}, options);
    ASSERT_TRUE(made && made->region);
    FineRegion region = *made->region;
    EXPECT_EQ(carry_into_region({made->volume, made->boundary}, {made->volume, made->boundary}, 1.5,
                                &region),
              0u);
    LabelVolume painted = made->volume;
    std::vector<std::uint32_t> records = dense_from_bricks<std::uint32_t>(made->boundary);
    const auto lesion = static_cast<std::uint8_t>(painted.labels.size());
    painted.labels.push_back({"lesion", "liver", 0, {0, 0, 0}});
    const Grid& g = painted.grid;
    const Point3 centre = region.box.centre() + Vector3{0.3, -0.7, 0.9};
    constexpr double kRadiusMm = 7;
    for (std::size_t n = 0; n < painted.voxels.size(); ++n) {
        const int i = static_cast<int>(n) % g.size.x, j = static_cast<int>(n) / g.size.x % g.size.y,
                  k = static_cast<int>(n) / g.size.x / g.size.y;
        const Vector3 in = centre - g.point_from_voxel({double(i), double(j), double(k)});
        const double d = (kRadiusMm - norm(in)) / 2;
        const std::uint8_t before = painted.voxels[n];
        if (d > 0) painted.voxels[n] = lesion;
        if (std::abs(d) < 1.5)
            records[n] = d > 0 ? pack_boundary({before, d, normalized(in)})
                               : pack_boundary({lesion, -d, -normalized(in)});
        else if (d > 0)
            records[n] = kNoBoundary;
    }
    const BoundaryBricks boundary(bricks_from_dense<std::uint32_t>(records, g.size));
    const std::size_t changed =
        carry_into_region({made->volume, made->boundary}, {painted, boundary}, 1.5, &region);
    EXPECT_GT(changed, 0u);
    const LabelVolume fine = volume_of(region, painted.labels);
    double ml = 0;
    std::size_t wrong = 0, near = 0;
    for (std::size_t n = 0; n < fine.voxels.size(); ++n) {
        const int i = static_cast<int>(n) % fine.grid.size.x,
                  j = static_cast<int>(n) / fine.grid.size.x % fine.grid.size.y,
                  k = static_cast<int>(n) / fine.grid.size.x / fine.grid.size.y;
        const Point3 p = fine.grid.point_from_voxel({double(i), double(j), double(k)});
        const double d = kRadiusMm - norm(p - centre);
        ml += fine.voxels[n] == lesion ? 0.5 * 0.5 * 0.5 / 1000 : 0;
        near += std::abs(d) > 0.3;
        wrong += std::abs(d) > 0.3 && (fine.voxels[n] == lesion) != (d > 0);
    }
    EXPECT_EQ(wrong, 0u) << "of " << near;
    EXPECT_NEAR(ml, 4.0 / 3 * 3.14159265 * kRadiusMm * kRadiusMm * kRadiusMm / 1000, 0.05);
}

}  // namespace
}  // namespace sonocase::pipeline
