// SPDX-License-Identifier: Apache-2.0

#include "pipeline/segmentation/snap_surfaces.h"

#include <gtest/gtest.h>

#include <cmath>

#include "formats/bundle/stage_files.h"
#include "formats/volume/boundary_record.h"
#include "pipeline/base/parallel.h"
#include "pipeline/segmentation/known_maps.h"
#include "pipeline/segmentation/resample_labels.h"
#include "support/random.h"
#include "support/shapes.h"

namespace sonocase::pipeline {
namespace {

using namespace sonocase::testing;  // shapes and maps of known answer

// A ball in a ball, cut by a plane, and a tube: organs, an edge and a vessel.
ResampleResult torso(double snap_vx) {
    const LabelVolume ct = sample_labels(cubic_grid(44), 5, [](Point3 p) {
        if (std::hypot(p.x - 0.3 * p.z, p.y - 4) < 2) return 4;
        if (norm_of(p) < 9) return 3;
        return norm_of(p) > 19 ? 0 : p.z < 0.2 * p.x ? 1 : 2;
    });
    Random random(3);
    const Registration registration = rigid_registration(random.rigid(20), ct.grid);
    ResampleOptions options;
    options.snap_vx = snap_vx;
    return std::move(*resample_labels({ct, registration}, options));
}

double measure(const ResampleResult& result, const std::string& name) {
    for (const Measure& m : result.report.measures) {
        if (m.name == name) return m.value;
    }
    ADD_FAILURE() << name;
    return 0;
}

TEST(SnapSurfaces, MovesNothingFurtherThanItIsAllowed) {
    const ResampleResult plain = torso(0), snapped = torso(0.07);
    const Grid& g = plain.volume.grid;
    std::size_t records = 0, flipped = 0;
    for (int k = 0; k < g.size.z; ++k) {
        for (int j = 0; j < g.size.y; ++j) {
            for (int i = 0; i < g.size.x; ++i) {
                const std::size_t v = g.index(i, j, k);
                const std::uint32_t a = plain.boundary.at(i, j, k);
                const std::uint32_t b = snapped.boundary.at(i, j, k);
                const bool flip = plain.volume.voxels[v] != snapped.volume.voxels[v];
                flipped += flip;
                if (a == kNoBoundary || b == kNoBoundary) {
                    EXPECT_FALSE(flip);
                    continue;
                }
                ++records;
                const double side = flip ? -1 : 1;
                EXPECT_LE(std::abs(side * unpack_boundary(b).distance_vx -
                                   unpack_boundary(a).distance_vx),
                          0.07 + 1e-9);
            }
        }
    }
    EXPECT_GT(records, 10000u);
    EXPECT_EQ(static_cast<double>(flipped), measure(snapped, "snap_labels"));
    // A flip needs a voxel within 0.07 of a surface: of those within 1.5, a twentieth at most.
    EXPECT_LT(flipped, records / 20);
}

TEST(SnapSurfaces, MostBricksAreKeptShortAndComeBackExactly) {
    const ResampleResult plain = torso(0), snapped = torso(0.07);
    EXPECT_GT(measure(snapped, "snapped_bricks"), 0.6 * measure(snapped, "record_bricks"));
    EXPECT_LT(measure(snapped, "snap_rms_vx"), 0.03);
    const auto file = [](const ResampleResult& r) {
        return write_label_file({"mannequin", r.volume, r.boundary, {}, {r.report}});
    };
    const std::vector<std::uint8_t> small = file(snapped);
    EXPECT_LT(3 * small.size(), 2 * file(plain).size());
    const auto back = read_label_file(small, "snapped");
    ASSERT_TRUE(back) << back.error().message();
    EXPECT_EQ(back->volume.voxels, snapped.volume.voxels);
    EXPECT_EQ(dense_from_bricks<std::uint32_t>(back->boundary),
              dense_from_bricks<std::uint32_t>(snapped.boundary));
}

TEST(SnapSurfaces, SameBytesForOneAndTwoThreads) {
    LabelVolume volume[2];
    BoundaryBricks boundary[2];
    const ResampleResult plain = torso(0);
    for (const int threads : {1, 2}) {
        const ThreadLimit limit(threads);
        volume[threads - 1] = plain.volume;
        boundary[threads - 1] = plain.boundary;
        snap_surfaces(&volume[threads - 1], &boundary[threads - 1]);
    }
    EXPECT_EQ(volume[0].voxels, volume[1].voxels);
    EXPECT_EQ(boundary[0].pool, boundary[1].pool);
    EXPECT_EQ(boundary[0].patches.patches, boundary[1].patches.patches);
}

}  // namespace
}  // namespace sonocase::pipeline
