// SPDX-License-Identifier: Apache-2.0

#include "pipeline/registration/register_surfaces.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "pipeline/anatomy/analytic_torso.h"
#include "pipeline/registration/map/map_proofs.h"
#include "support/fit_report.h"
#include "support/hard_case.h"
#include "support/random.h"

namespace sonocase::pipeline {
namespace {

using sonocase::testing::Random;

// The analytic torso's skin, extracted once.
const SkinSurfaceResult& torso_skin() {
    static const SkinSurfaceResult skin = [] {
        auto result = extract_skin_surface(sample_analytic_torso(analytic_torso_grid({3, 3, 3})));
        return std::move(*result);
    }();
    return skin;
}

struct TargetError {
    double mean = 0, p95 = 0;
};

// Distance between two maps at places inside the body, mm.
TargetError target_error(const Registration& fitted, const Registration& truth) {
    const Grid grid = analytic_torso_grid({15, 15, 15});
    std::vector<double> error;
    for (int k = 0; k < grid.size.z; ++k) {
        for (int j = 0; j < grid.size.y; ++j) {
            for (int i = 0; i < grid.size.x; ++i) {
                const Point3 p = grid.point_from_voxel({1.0 * i, 1.0 * j, 1.0 * k});
                if (analytic_torso_label(p) == 0) continue;
                error.push_back(
                    distance(mannequin_from_ct(fitted, p), mannequin_from_ct(truth, p)));
            }
        }
    }
    std::sort(error.begin(), error.end());
    TargetError t;
    for (double e : error) t.mean += e / static_cast<double>(error.size());
    t.p95 = error[error.size() * 95 / 100];
    return t;
}

TEST(RegisterSurfaces, RecoversTheAnalyticTorsosKnownWarp) {
    const Registration truth = analytic_torso_truth();
    const Surface mannequin = analytic_torso_mannequin();
    const auto result = register_surfaces({torso_skin(), mannequin});
    ASSERT_TRUE(result) << result.error().message();
    const TargetError error = target_error(result->registration, truth);
    Registration rigid = result->registration;
    rigid.residual = {};
    rigid.quadratic = QuadraticMap::from_rigid(rigid.mannequin_from_ct, {}, 200);
    // Voxels of 3 mm leave 0.4 mm of steps on this smooth skin, and they steer the tangential part.
    EXPECT_LT(error.mean, 3.0);
    EXPECT_LT(error.p95, 6.0);
    EXPECT_LT(error.mean, target_error(rigid, truth).mean);
    EXPECT_LT(result->fit.rms_mm, 0.9);  // the noise is 0.7
    EXPECT_GT(result->registration.min_det_jacobian, 0.2);
}

// The same readings give the same map, wherever the search begins: what a case teaches must not
// depend on a number that nobody chose. Two bodies that differ, so that the fit has a choice.
TEST(RegisterSurfaces, GivesTheSameMapForAnySeedAndAnyNumberOfStarts) {
    const Surface mannequin = analytic_torso_mannequin();
    const auto fit = [&](std::uint64_t seed, int starts) {
        RegisterOptions options;
        options.seed = seed;
        options.rigid.starts = starts;
        return register_surfaces({torso_skin(), mannequin}, options)->registration;
    };
    testing::HardCase off("places inside, other seeds and starts, 95 %", testing::HardCase::at_most,
                          0.5, "mm");
    const Registration first = fit(1, 96);
    for (const auto& [seed, starts] : {std::pair{2, 96}, std::pair{3, 96}, std::pair{4, 150}}) {
        SCOPED_TRACE(::testing::Message() << "seed " << seed << ", starts " << starts);
        off.see(target_error(fit(seed, starts), first).p95);
    }
}

// The tracker's frame is chance as well.
TEST(RegisterSurfaces, GivesTheSameMapInAnyFrameOfTheTracker) {
    const Surface mannequin = analytic_torso_mannequin();
    const auto first = register_surfaces({torso_skin(), mannequin});
    ASSERT_TRUE(first) << first.error().message();
    Random random(4);
    for (int n = 0; n < 2; ++n) {
        const Rigid turn = random.rigid(400);
        Surface turned = mannequin;
        for (Point3& p : turned.points) p = turn * p;
        const auto fitted = register_surfaces({torso_skin(), turned});
        ASSERT_TRUE(fitted) << fitted.error().message();
        std::vector<double> off;
        for (double z = -120; z <= 120; z += 40) {
            for (double x = -100; x <= 100; x += 40) {
                const Point3 p{x, 0, z};
                off.push_back(distance(mannequin_from_ct(fitted->registration, p),
                                       turn * mannequin_from_ct(first->registration, p)));
            }
        }
        std::sort(off.begin(), off.end());
        EXPECT_LT(off[off.size() * 95 / 100], 0.5);
    }
}

TEST(RegisterSurfaces, SaysForEachStructureWhatTheReadingsLeaveOpen) {
    const LabelVolume labels = sample_analytic_torso(analytic_torso_grid({3, 3, 3}));
    const Surface mannequin = analytic_torso_mannequin();
    const auto result = register_surfaces({torso_skin(), mannequin, &labels});
    ASSERT_TRUE(result) << result.error().message();
    EXPECT_FALSE(result->unknown.empty());
    for (const OrganUnknown& u : result->unknown) {
        EXPECT_GT(u.median_mm, 0) << u.label;
        EXPECT_LT(u.median_mm, u.p95_mm) << u.label;
    }
    const double open = testing::measure(*result, "predicted_interior_mm");
    const double held = testing::measure(*result, "interior_with_two_landmarks_mm");
    EXPECT_GT(held, 0);
    EXPECT_LT(held, open);
}

// Bad input and poor sweeps: results or one line of text, never a crash or a silent guess.
Surface sweep(int points, std::uint64_t seed) {
    AnalyticMannequinOptions options;
    options.points = points;
    options.seed = seed;
    return analytic_torso_mannequin(options);
}

TEST(RegisterSurfaces, ASweepInMetresIsRefusedWithItsFactor) {
    Surface s = sweep(500, 3);
    for (Point3& p : s.points) p = {p.x / 1000, p.y / 1000, p.z / 1000};
    const auto result = register_surfaces({torso_skin(), s});
    ASSERT_FALSE(result);
    EXPECT_NE(result.error().message().find("metres"), std::string::npos);
}

TEST(RegisterSurfaces, FlatAndStraightSweepsAreRefusedWithTheirSize) {
    Surface flat = sweep(500, 4), straight = flat;
    for (Point3& p : flat.points) p.z = 7;
    for (Point3& p : straight.points) p = {p.x, 2 * p.x, -p.x};
    const auto a = register_surfaces({torso_skin(), flat});
    const auto b = register_surfaces({torso_skin(), straight});
    ASSERT_FALSE(a);
    ASSERT_FALSE(b);
    EXPECT_NE(a.error().message().find("plane"), std::string::npos);
    EXPECT_NE(b.error().message().find("line"), std::string::npos);
}

TEST(RegisterSurfaces, NotFiniteAndRepeatedRowsAreLeftOutAndCounted) {
    Surface s = sweep(600, 5);
    const std::size_t count = s.points.size();
    for (std::size_t i = 0; i < 50; ++i) s.points.push_back(s.points[7 * i]);
    for (int i = 0; i < 20; ++i) s.points.push_back({NAN, 0, 1});
    const auto target = prepare_target(s);
    ASSERT_TRUE(target);
    EXPECT_EQ(target->points.size(), count);
    EXPECT_EQ(target->repeated, 50);
    EXPECT_EQ(target->not_finite, 20);
}

TEST(RegisterSurfaces, FiftyPointsGiveAnAnswerAndAWarning) {
    const auto result = register_surfaces({torso_skin(), sweep(50, 6)});
    ASSERT_TRUE(result) << result.error().message();
    EXPECT_FALSE(result->report.warnings.empty());
    EXPECT_GT(result->registration.min_det_jacobian, 0.2);
}

TEST(FoldProof, KnowsTheDeterminantOfAKnownFold) {
    // y_x = x + x^2 / 200 has det 1 + x / 100 on [-95, 100]: 0.05 at the left face.
    Registration r;
    r.quadratic.coefficients[0] = {0, 1, 0, 0, 1 / 200.0, 0, 0, 0, 0, 0};
    r.quadratic.coefficients[1] = {0, 0, 1, 0, 0, 0, 0, 0, 0, 0};
    r.quadratic.coefficients[2] = {0, 0, 0, 1, 0, 0, 0, 0, 0, 0};
    r.ct_box.include(Point3{-95, -100, -100});
    r.ct_box.include(Point3{100, 100, 100});
    const FoldProof proof = prove_no_fold(r);
    EXPECT_NEAR(proof.min_bound, 0.05, 1e-6);
    EXPECT_LE(proof.min_bound, proof.min_sample);
}

TEST(FoldProof, NeverLiesAboveDenseSamples) {
    for (std::uint64_t seed = 1; seed <= 8; ++seed) {
        SCOPED_TRACE(::testing::Message() << "seed " << seed);
        Random random(seed);
        Registration r;
        r.ct_box.include(Point3{-100, -80, -90});
        r.ct_box.include(Point3{100, 80, 90});
        r.quadratic = QuadraticMap::from_rigid(random.rigid(50), {}, 100);
        for (auto& row : r.quadratic.coefficients) {
            for (std::size_t c = 1; c < 10; ++c) row[c] += random.uniform(-10, 10);
        }
        if (seed % 2 == 0) {
            r.residual.spacing_mm = 40;
            r.residual.origin_mm = {-100, -80, -100};
            r.residual.size = {8, 7, 8};
            for (int i = 0; i < 8 * 7 * 8; ++i) {
                r.residual.control_mm.push_back(
                    {2 * random.gaussian(), 2 * random.gaussian(), 2 * random.gaussian()});
            }
        }
        const FoldProof proof = prove_no_fold(r);
        double smallest = 1e9;
        for (int i = 0; i < 20000; ++i) {
            const Point3 p{random.uniform(-100, 100), random.uniform(-80, 80),
                           random.uniform(-90, 90)};
            smallest = std::min(smallest, determinant(jacobian(r, p)));
        }
        EXPECT_LE(proof.min_bound, smallest + 1e-9);
        EXPECT_LE(proof.min_bound, proof.min_sample);
        EXPECT_GT(proof.min_bound, proof.min_sample - 0.05);  // and is not far below it
    }
}

// Nearest neighbours below a bound and from a guess, beside a comparison with all points.
std::vector<Point3> cloud(std::size_t count, Random& random) {
    std::vector<Point3> points;
    for (std::size_t i = 0; i < count; ++i)
        points.push_back(
            {random.uniform(-200, 200), random.uniform(-100, 100), random.uniform(-300, 300)});
    return points;
}

std::uint32_t nearest_of_all(const std::vector<Point3>& points, Point3 p) {
    std::uint32_t best = 0;
    for (std::uint32_t i = 1; i < points.size(); ++i)
        if (distance(points[i], p) < distance(points[best], p)) best = i;
    return best;
}

TEST(PointIndex, AGuessChangesTheCostAlone) {
    Random random(3);
    const std::vector<Point3> points = cloud(800, random);
    const PointIndex index(points);
    for (const Point3 p : cloud(500, random)) {
        const std::uint32_t nearest = nearest_of_all(points, p);
        EXPECT_EQ(index.nearest(p), nearest);
        for (const std::uint32_t guess : {nearest, 0u, 399u, PointIndex::kNone}) {
            double d2 = 0;
            EXPECT_EQ(index.nearest_within(p, INFINITY, guess, &d2), nearest);
            EXPECT_NEAR(std::sqrt(d2), distance(points[nearest], p), 1e-9);
        }
    }
}

TEST(PointIndex, WhatLiesBeyondTheBoundIsNotFound) {
    Random random(4);
    const std::vector<Point3> points = cloud(800, random);
    const PointIndex index(points);
    int within = 0;
    for (const Point3 p : cloud(500, random)) {
        const std::uint32_t nearest = nearest_of_all(points, p);
        const bool near = distance(points[nearest], p) < 25;
        within += near;
        for (const std::uint32_t guess : {nearest, 7u, PointIndex::kNone})
            EXPECT_EQ(index.nearest_within(p, 25 * 25, guess), near ? nearest : PointIndex::kNone);
    }
    EXPECT_GT(within, 50);  // both kinds are there
    EXPECT_LT(within, 450);
}

// Of points that are equally near any may be taken; of equal points one is.
TEST(PointIndex, EqualPointsAreFound) {
    const std::vector<Point3> points(40, {1, 2, 3});
    const PointIndex index(points);
    double d2 = 1;
    EXPECT_LT(index.nearest_within({1, 2, 3}, 1, 5, &d2), 40u);
    EXPECT_EQ(d2, 0);
    EXPECT_EQ(index.nearest_within({1, 2, 9}, 1, PointIndex::kNone), PointIndex::kNone);
}

}  // namespace
}  // namespace sonocase::pipeline
