// SPDX-License-Identifier: Apache-2.0

// The fitted map: quadratic fit, Jacobians, fold proof, Newton inverse, residual spline.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "numerics/property.h"
#include "pipeline/registration/map/inverse_map.h"
#include "pipeline/registration/map/map_proofs.h"
#include "pipeline/registration/map/registration.h"
#include "support/hard_case.h"

namespace sonocase::numerics {
namespace {

using testing::HardCase;

using pipeline::InverseMap;
using pipeline::MapStatus;

Registration random_map(testing::Random& random, double bend, bool residual, double away = 0) {
    Registration r;
    r.mannequin_from_ct = random.rigid(100);
    const Point3 centre{away, -away, away};
    r.quadratic = QuadraticMap::from_rigid(r.mannequin_from_ct, centre, 200);
    for (auto& row : r.quadratic.coefficients) {
        for (std::size_t c = 1; c < 10; ++c)
            row[c] += bend * random.uniform(-1, 1) * (c < 4 ? 1 : 0.7);
    }
    for (int c = 0; c < 3; ++c) {
        r.ct_box.lower[c] = centre[c] - 150;
        r.ct_box.upper[c] = centre[c] + 150;
    }
    if (residual) {
        r.residual.size = {9, 9, 9};
        r.residual.origin_mm = r.ct_box.lower;
        r.residual.spacing_mm = 50;
        for (int i = 0; i < 729; ++i) {
            r.residual.control_mm.push_back(
                {random.uniform(-3, 3), random.uniform(-3, 3), random.uniform(-3, 3)});
        }
    }
    return r;
}

Point3 inside(testing::Random& random, const Box3& box) {
    Point3 p;
    for (int c = 0; c < 3; ++c) p[c] = random.uniform(box.lower[c] + 1, box.upper[c] - 1);
    return p;
}

// Worst difference between quotients and the Jacobian over its bound, which has order two.
double quotients_over_bound(testing::Random random) {
    const Registration map = random_map(random, 20, true);
    const Point3 p = inside(random, map.ct_box);
    const Matrix3 exact = jacobian(map, p);
    double before = 0, over = 0;
    for (double step : {0.4, 0.2}) {
        double worst = 0;
        for (int c = 0; c < 3; ++c) {
            Point3 up = p, down = p;
            up[c] += step;
            down[c] -= step;
            const Vector3 d =
                (mannequin_from_ct(map, up) - mannequin_from_ct(map, down)) / (2 * step);
            for (int r = 0; r < 3; ++r) worst = std::max(worst, std::abs(d[r] - exact(r, c)));
        }
        // Third derivatives of a cubic spline jump at knots: bounded by 3 mm * 6 / 50^3 a control
        // point.
        over = std::max(over, worst / (0.002 * step * step + 1e-10));
        if (before > 1e-7) over = std::max(over, worst / (0.5 * before));
        before = worst;
    }
    return over;
}

RC_GTEST_PROP(WarpNumerics, JacobianIsTheLimitOfDifferencesWithOrderTwo, ()) {
    RC_ASSERT(quotients_over_bound(random_case()) <= 1);
}

TEST(WarpNumerics, JacobianIsTheLimitInFiveHundredMaps) {
    HardCase off("quotients off the Jacobian, over the bound, 500 maps", HardCase::at_most, 1, "");
    for (std::uint64_t seed = 1; seed <= 500; ++seed)
        off.see(quotients_over_bound(testing::Random(seed)));
}

// Worst of twenty ways there and back over its bound; -1: the map is not proven. 1e-9 mm of
// residual, through a Jacobian whose inverse is at most about 5, and rounding far out.
double loop_over_bound(testing::Random random) {
    const double away = random.uniform(0, 1) < 0.3 ? 1e4 : 0;
    const Registration map = random_map(random, 12, random.uniform(0, 1) < 0.5, away);
    if (pipeline::prove_no_fold(map).min_bound <= pipeline::kMinDetJacobian) return -1;
    const InverseMap inverse_map(map);
    double worst = 0;
    for (int k = 0; k < 20; ++k) {
        const Point3 ct = inside(random, map.ct_box);
        Point3 back;
        if (inverse_map.invert(mannequin_from_ct(map, ct), &back) != MapStatus::ok) return 1e9;
        worst = std::max(worst, distance(back, ct) / (1e-8 + 1e-13 * away * 100));
    }
    Point3 nowhere;
    return inverse_map.invert({1e6, 1e6, 1e6}, &nowhere) != MapStatus::ok ? worst : 1e9;
}

RC_GTEST_PROP(WarpNumerics, InverseReturnsToTheStartOrSaysThatThereIsNone, ()) {
    const double worst = loop_over_bound(random_case());
    RC_PRE(worst >= 0);
    RC_ASSERT(worst < 1);
}

TEST(WarpNumerics, InverseOfTwoHundredMapsOverItsBound) {
    HardCase loop("there and back over the bound, 200 maps, some 1e4 mm away", HardCase::at_most, 1,
                  "");
    int proven = 0;
    for (std::uint64_t seed = 1; proven < 200; ++seed)
        if (const double worst = loop_over_bound(testing::Random(seed)); worst >= 0) {
            loop.see(worst);
            ++proven;
        }
}

RC_GTEST_PROP(WarpNumerics, FoldProofIsNeverAboveASample, ()) {
    testing::Random random = random_case();
    const Registration map = random_map(random, random.uniform(1, 120), random.uniform(0, 1) < 0.3);
    const pipeline::FoldProof proof = pipeline::prove_no_fold(map);
    RC_ASSERT(proof.min_bound <= proof.min_sample);
    for (int k = 0; k < 200; ++k) {
        RC_ASSERT(determinant(jacobian(map, inside(random, map.ct_box))) >= proof.min_bound);
    }
}

TEST(WarpNumerics, FoldProofOfAHundredMapsIsBelowTheSamplesAndNotFar) {
    HardCase above("bound above a sample of det J, a hundred maps", HardCase::at_most, 0, "");
    HardCase below("bound below the least of 200 samples, median", HardCase::at_most, 1, "");
    std::vector<double> gap;
    for (std::uint64_t seed = 1; seed <= 100; ++seed) {
        testing::Random random(seed);
        const Registration map =
            random_map(random, random.uniform(1, 120), random.uniform(0, 1) < 0.3);
        const pipeline::FoldProof proof = pipeline::prove_no_fold(map);
        double least = proof.min_sample;
        for (int k = 0; k < 200; ++k)
            least = std::min(least, determinant(jacobian(map, inside(random, map.ct_box))));
        above.see(std::max(0.0, proof.min_bound - least));
        gap.push_back(least - proof.min_bound);
    }
    std::nth_element(gap.begin(), gap.begin() + 50, gap.end());
    below.see(gap[50]);
}

TEST(WarpNumerics, GuardFiresOnAFold) {
    testing::Random random(1);
    Registration map = random_map(random, 0, false);
    map.quadratic.coefficients[0][4] += 400;  // x -> x + 400 (x / 200)^2 turns back within the box
    EXPECT_LT(pipeline::prove_no_fold(map).min_bound, 0);
}

TEST(WarpNumerics, IdentityIsExact) {
    Registration map;
    map.quadratic = QuadraticMap::from_rigid({}, {0, 0, 0}, 256);  // a power of two: no rounding
    map.ct_box.include({-100, -100, -100});
    map.ct_box.include({100, 100, 100});
    EXPECT_EQ(mannequin_from_ct(map, {12.25, -3.5, 99}), (Point3{12.25, -3.5, 99}));
    // Minus the margin that the proof subtracts for rounding.
    EXPECT_NEAR(pipeline::prove_no_fold(map).min_bound, 1, 1e-11);
    EXPECT_LE(pipeline::prove_no_fold(map).min_bound, 1);
}

// Worst of twenty places of a linear field, and of its slopes, over the rounding.
double linear_field_over_bound(testing::Random random) {
    DisplacementGrid grid;
    grid.size = {7, 8, 6};
    grid.spacing_mm = std::pow(10.0, random.uniform(-1, 3));
    grid.origin_mm = random.point(1000);
    const Vector3 constant = random.direction();
    const Matrix3 slope = random.rotation();
    for (int k = 0; k < 6; ++k) {
        for (int j = 0; j < 8; ++j) {
            for (int i = 0; i < 7; ++i) {
                const Vector3 at{(i - 1) * grid.spacing_mm, (j - 1) * grid.spacing_mm,
                                 (k - 1) * grid.spacing_mm};
                grid.control_mm.push_back(constant + slope * at);
            }
        }
    }
    double over = 0;
    for (int n = 0; n < 20; ++n) {
        const Vector3 u{random.uniform(0, 4) * grid.spacing_mm,
                        random.uniform(0, 5) * grid.spacing_mm,
                        random.uniform(0, 3) * grid.spacing_mm};
        const Vector3 d = displacement(grid, grid.origin_mm + u);
        const double size = 1 + 10 * grid.spacing_mm;
        const double bound = 1e3 * kEpsilon * (size + 1000);
        over = std::max(over, norm(d - (constant + slope * u)) / bound);
        const Matrix3 j = displacement_jacobian(grid, grid.origin_mm + u);
        for (std::size_t m = 0; m < 9; ++m)
            over = std::max(over, std::abs(j.m[m] - slope.m[m]) * grid.spacing_mm / bound);
    }
    return over;
}

RC_GTEST_PROP(ResidualWarpNumerics, SplineIsAPartitionOfUnityAndReproducesLinearFields, ()) {
    RC_ASSERT(linear_field_over_bound(random_case()) <= 1);
}

TEST(ResidualWarpNumerics, LinearFieldsOfFiveHundredGridsComeBack) {
    HardCase off("linear field by the spline, off, over the rounding, 500 grids", HardCase::at_most,
                 1, "");
    for (std::uint64_t seed = 1; seed <= 500; ++seed)
        off.see(linear_field_over_bound(testing::Random(seed)));
}

}  // namespace
}  // namespace sonocase::numerics
