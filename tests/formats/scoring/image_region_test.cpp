// SPDX-License-Identifier: Apache-2.0

#include "formats/scoring/sight.h"

#include <gtest/gtest.h>

#include "support/random.h"

namespace sonocase {
namespace {

std::vector<Probe> probes() {
    Probe linear, curved, phased;
    linear.shape = ProbeShape::linear;
    linear.width_mm = 40;
    linear.depth_mm = 60;
    curved.shape = ProbeShape::curvilinear;
    curved.radius_mm = 60;
    curved.field_of_view_rad = 1.2;
    curved.depth_mm = 150;
    phased.shape = ProbeShape::phased;
    phased.field_of_view_rad = 1.5;
    phased.depth_mm = 120;
    return {linear, curved, phased};
}

TEST(ImageRegion, DistanceIsThatToTheNearestPointOfAFineGrid) {
    testing::Random random(6);
    for (const Probe& probe : probes()) {
        std::vector<Point3> grid;
        constexpr double kStep = 0.5;
        for (double z = -40; z <= 160; z += kStep) {
            for (double x = -120; x <= 120; x += kStep) {
                if (in_image(probe, x, z)) grid.push_back({x, 0, z});
            }
        }
        for (int i = 0; i < 60; ++i) {
            const double x = random.uniform(-150, 150), z = random.uniform(-80, 220);
            double least = 1e9;
            for (const Point3& g : grid) least = std::min(least, std::hypot(g.x - x, g.z - z));
            const double d = distance_to_image(probe, x, z);
            EXPECT_EQ(d == 0, in_image(probe, x, z)) << x << " " << z;
            EXPECT_LE(d, least + 1e-9);
            EXPECT_GE(d, least - 1.5 * kStep) << x << " " << z;
        }
    }
}

TEST(ImageRegion, LengthInImageIsThatOfManySmallSteps) {
    testing::Random random(7);
    for (const Probe& probe : probes()) {
        const double radius = probe.shape == ProbeShape::curvilinear ? probe.radius_mm : 0;
        const double chord = probe.shape == ProbeShape::linear
                                 ? 0
                                 : radius * (std::cos(probe.field_of_view_rad / 2) - 1);
        for (int i = 0; i < 200; ++i) {
            const Point3 a{random.uniform(-90, 90), random.uniform(-6, 6),
                           random.uniform(-20, 170)};
            const Point3 b{random.uniform(-90, 90), random.uniform(-6, 6),
                           random.uniform(-20, 170)};
            constexpr int kSteps = 20000;
            int inside = 0;
            for (int s = 0; s < kSteps; ++s) {
                const Point3 p = a + ((s + 0.5) / kSteps) * (b - a);
                // The hollow between a curved face and its chord counts as inside, as the header
                // says.
                const double r = std::hypot(p.x, p.z + radius);
                const bool hollow =
                    probe.shape == ProbeShape::curvilinear && r < radius && p.z >= chord &&
                    std::abs(std::atan2(p.x, p.z + radius)) <= probe.field_of_view_rad / 2;
                if (std::abs(p.y) <= 1.5 && (in_image(probe, p.x, p.z) || hollow)) ++inside;
            }
            const double slow = distance(a, b) * inside / kSteps;
            EXPECT_NEAR(length_in_image(probe, a, b, 1.5), slow, 3 * distance(a, b) / kSteps);
        }
    }
}

TEST(ImageRegion, NeedlesInThePlaneAndAcrossIt) {
    const Probe linear = probes()[0];
    EXPECT_DOUBLE_EQ(length_in_image(linear, {0, 0, 10}, {0, 0, 50}, 1.5), 40);
    EXPECT_DOUBLE_EQ(length_in_image(linear, {0, -20, 30}, {0, 20, 30}, 1.5), 3);
    EXPECT_EQ(length_in_image(linear, {0, 2, 10}, {0, 2, 50}, 1.5), 0);
    EXPECT_EQ(length_in_image(linear, {0, 0, 10}, {0, 0, 10}, 1.5), 0);
}

}  // namespace
}  // namespace sonocase
