// SPDX-License-Identifier: Apache-2.0

// Needle constraint and scan geometry.
#include <gtest/gtest.h>

#include <cmath>

#include "numerics/property.h"
#include "runtime/engine/needle_state.h"
#include "runtime/imaging/core/scan_geometry.h"
#include "support/hard_case.h"

namespace sonocase::numerics {
namespace {

using testing::HardCase;

using namespace sonocase::runtime;

TEST(NeedleConstraintNumerics, WeightOfAnyDepthStaysInRange) {
    NeedleConstraintOptions o;
    HardCase beyond("weight of depths from -1e300 to 1e300, beyond its range", HardCase::at_most, 0,
                    "");
    for (double steepness : {1e-3, 1.0, 10.0}) {
        o.steepness_per_mm = steepness;
        for (double depth : {-1e300, -5.0, 0.0, 1e-9, 10.0, 120.0, 1e6, 1e300}) {
            const double w = needle_constraint_weight(depth, o);
            beyond.see(std::max({0.0, -w, w - o.max_weight}));
        }
    }
}

RC_GTEST_PROP(NeedleConstraintNumerics, WeightIsThatOfLongDoubleRisesAndStaysInRange, ()) {
    testing::Random random = random_case();
    NeedleConstraintOptions o;
    o.max_weight = random.uniform(0, 1);
    o.steepness_per_mm = std::pow(10.0, random.uniform(-3, 1));
    o.midpoint_mm = random.uniform(0, 300);
    double before = -1;
    for (double depth : {0.0, 1e-9, 10.0, 120.0, 500.0, 1e6, 1e300}) {
        const double w = needle_constraint_weight(depth, o);
        const long double z = -static_cast<long double>(o.steepness_per_mm) *
                              (static_cast<long double>(depth) - o.midpoint_mm);
        const long double truth = o.max_weight / (1 + std::exp(z));
        // The exponent's own rounding is multiplied by its size; below the normal numbers the
        // exponential overflows and the weight may be 0.
        const double bound = 8 * kEpsilon *
                                 (1 + std::min(700.0, std::abs(static_cast<double>(z)))) *
                                 static_cast<double>(truth) +
                             std::numeric_limits<double>::min();
        RC_ASSERT(std::abs(w - static_cast<double>(truth)) <= bound);
        RC_ASSERT(w >= before && w >= 0 && w <= o.max_weight);
        before = w;
    }
    RC_ASSERT(needle_constraint_weight(-5, o) == needle_constraint_weight(0, o));
}

RC_GTEST_PROP(NeedleConstraintNumerics, DirectionIsUnitInThePlaneOfTheTwoAndTurnsWithThem, ()) {
    testing::Random random = random_case();
    const Vector3 entry = random.direction(), measured = random.direction();
    const double depth = random.uniform(0, 400);
    const Vector3 d = constrain_needle_direction(entry, measured, depth);
    RC_ASSERT(std::abs(norm(d) - 1) < 4 * kEpsilon);
    RC_ASSERT(std::abs(dot(d, cross(entry, measured))) < 1e-14);
    const Matrix3 turn = random.rotation();
    const Vector3 turned = constrain_needle_direction(turn * entry, turn * measured, depth);
    const double blend = std::max(1e-3, norm(entry + measured));
    RC_ASSERT(norm(turned - turn * d) < 1e-14 / blend * 10);
}

TEST(NeedleConstraintNumerics, GuardForCancellingDirectionsFires) {
    const Vector3 z{0, 0, 1};
    HardCase unit("length of the direction, off 1", HardCase::at_most, 1e-15, "");
    EXPECT_EQ(constrain_needle_direction(z, -z, 120), -z);
    for (double depth : {0.0, 60.0, 119.9, 120.1, 300.0}) {
        const Vector3 d = constrain_needle_direction(z, -z, depth);
        unit.see(std::abs(norm(d) - 1));
        EXPECT_TRUE(std::isfinite(d.z));
    }
}

Probe random_probe(testing::Random& random, ProbeShape shape) {
    Probe p;
    p.shape = shape;
    p.radius_mm = random.uniform(5, 80);
    p.field_of_view_rad = random.uniform(0.2, 2.6);
    p.width_mm = random.uniform(20, 80);
    p.depth_mm = random.uniform(20, 300);
    return p;
}

// Twenty places of each shape, found again: beam and sample off, over the bound.
double places_over_bound(testing::Random random) {
    double worst = 0;
    for (ProbeShape shape : {ProbeShape::linear, ProbeShape::curvilinear, ProbeShape::phased}) {
        const ScanGeometry g = make_scan_geometry(random_probe(random, shape), 256, 400, 512, 384);
        for (int n = 0; n < 20; ++n) {
            const double line = random.uniform(0, 255), sample = random.uniform(0.5, 398);
            double l = -1, s = -1;
            if (!g.locate(g.point(line, sample), l, s)) return INFINITY;
            worst = std::max(worst, std::abs(s - sample) / 1e-9);
            // All beams meet at the apex of a sector: the beam is determined only as well as the
            // arc is long.
            const double arc = std::max(1e-3, (sample + 0.5) * g.step_mm + g.radius_mm);
            worst = std::max(worst, std::abs(l - line) / (1e-9 * (1 + 256 / arc)));
        }
        const PlanePoint d = g.beam_direction(100);
        worst = std::max(worst, std::abs(std::hypot(d.x, d.z) - 1) / (4 * kEpsilon));
    }
    return worst;
}

RC_GTEST_PROP(ScanGeometryNumerics, PointAndLocateAreInverse, ()) {
    RC_ASSERT(places_over_bound(random_case()) < 1);
}

TEST(ScanGeometryNumerics, PlacesOfAThousandProbesAreFoundAgain) {
    HardCase off("places of 1,000 probes found again, off, over the bound", HardCase::at_most, 1,
                 "");
    for (std::uint64_t seed = 1; seed <= 1000; ++seed)
        off.see(places_over_bound(testing::Random(seed)));
}

RC_GTEST_PROP(ScanGeometryNumerics, PictureIsSymmetricAndHoldsTheWholeScan, ()) {
    testing::Random random = random_case();
    for (ProbeShape shape : {ProbeShape::linear, ProbeShape::curvilinear, ProbeShape::phased}) {
        const ScanGeometry g = make_scan_geometry(random_probe(random, shape), 128, 200, 401, 300);
        const PlanePoint left = g.point(10, 150), right = g.point(117, 150);  // 10 and 127 - 10
        RC_ASSERT(std::abs(left.x + right.x) < 1e-9 && std::abs(left.z - right.z) < 1e-9);
        for (double line : {0.0, 127.0}) {
            for (double sample : {0.0, 199.0}) {
                const PlanePoint p = g.point(line, sample);
                const double u = p.x / g.mm_per_px + g.origin_x_px,
                             v = p.z / g.mm_per_px + g.origin_y_px;
                RC_ASSERT(u > -0.5 && u < g.width_px && v > -0.5 && v < g.height_px);
            }
        }
    }
}

TEST(ScanGeometryNumerics, OutsideTheScanIsOutside) {
    testing::Random random(1);
    for (ProbeShape shape : {ProbeShape::linear, ProbeShape::curvilinear, ProbeShape::phased}) {
        const ScanGeometry g = make_scan_geometry(random_probe(random, shape), 128, 200, 401, 300);
        double l = 0, s = 0;
        EXPECT_FALSE(g.locate({0, g.depth_mm + 50}, l, s));
        EXPECT_FALSE(g.locate({1e6, 10}, l, s));
        EXPECT_FALSE(g.locate({0, -2 * g.radius_mm - 10}, l, s));
        EXPECT_FALSE(g.locate({NAN, 10}, l, s));
    }
}

}  // namespace
}  // namespace sonocase::numerics
