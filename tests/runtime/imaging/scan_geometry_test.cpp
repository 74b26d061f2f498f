// SPDX-License-Identifier: Apache-2.0

#include "runtime/imaging/core/scan_geometry.h"

#include <gtest/gtest.h>

#include "support/random.h"

namespace sonocase::runtime {
namespace {

using sonocase::testing::Random;

Probe probe_of(ProbeShape shape) {
    Probe p;
    p.shape = shape;
    return p;
}

TEST(ScanGeometry, LocateInvertsPointForEveryShape) {
    for (const ProbeShape shape :
         {ProbeShape::linear, ProbeShape::curvilinear, ProbeShape::phased}) {
        const ScanGeometry g = make_scan_geometry(probe_of(shape), 192, 512, 512, 512);
        Random random(3);
        for (int i = 0; i < 1000; ++i) {
            const double line = random.uniform(-0.4, 191.4), sample = random.uniform(-0.4, 511.4);
            double l = 0, k = 0;
            EXPECT_TRUE(g.locate(g.point(line, sample), l, k));
            // A phased array's beams meet at the tip: rounding there grows as 1 / distance.
            EXPECT_NEAR(l, line, 1e-7);
            EXPECT_NEAR(k, sample, 1e-9);
        }
    }
}

TEST(ScanGeometry, EveryScannedPointHasAPixel) {
    for (const ProbeShape shape :
         {ProbeShape::linear, ProbeShape::curvilinear, ProbeShape::phased}) {
        for (const double fov : {0.4, 1.2, 2.5, 4.0}) {
            Probe probe = probe_of(shape);
            probe.field_of_view_rad = fov;
            const ScanGeometry g = make_scan_geometry(probe, 64, 64, 300, 200);
            for (int l = 0; l < 64; ++l) {
                for (int k = 0; k < 64; ++k) {
                    const PlanePoint p = g.point(l, k);
                    const double x = p.x / g.mm_per_px + g.origin_x_px,
                                 y = p.z / g.mm_per_px + g.origin_y_px;
                    EXPECT_TRUE(x > -0.5 && x < 299.5 && y > -0.5 && y < 199.5)
                        << fov << " " << x << " " << y;
                }
            }
        }
    }
}

TEST(ScanGeometry, PictureIsSymmetricSoThatAFlipMirrorsIt) {
    const ScanGeometry g =
        make_scan_geometry(probe_of(ProbeShape::curvilinear), 100, 100, 301, 200);
    for (int column = 0; column < 301; ++column) {
        EXPECT_NEAR(g.pixel_centre(column, 50).x, -g.pixel_centre(300 - column, 50).x, 1e-12);
    }
}

TEST(ScanConversionTable, NamesTheSamplesRoundAPixel) {
    const ScanGeometry g =
        make_scan_geometry(probe_of(ProbeShape::curvilinear), 192, 512, 256, 256);
    const ScanConversionTable table = make_scan_conversion_table(serial_jobs(), g, 192);
    ASSERT_FALSE(table.runs.empty());
    for (const PixelRun& run : table.runs) {
        for (int c = run.begin; c < run.end; ++c) {
            const std::size_t i = run.entry + static_cast<std::size_t>(c - run.begin);
            double line = 0, sample = 0;
            ASSERT_TRUE(g.locate(g.pixel_centre(c, run.row), line, sample));
            // Half a step of the byte, and its last step, which is lost.
            EXPECT_NEAR(table.offset[i] % 192 + (table.weight[i] & 255) / 256.0,
                        std::clamp(line, 0.0, 191.0), 1.01 / 256);
            EXPECT_NEAR(table.offset[i] / 192 + (table.weight[i] >> 8) / 256.0,
                        std::clamp(sample, 0.0, 511.0), 1.01 / 256);
        }
    }
}

}  // namespace
}  // namespace sonocase::runtime
