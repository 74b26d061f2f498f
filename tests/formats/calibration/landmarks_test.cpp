// SPDX-License-Identifier: Apache-2.0

#include "formats/calibration/landmarks.h"
#include "formats/base/constants.h"
#include "support/hard_case.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstdio>

#include "support/random.h"

namespace sonocase {
namespace {

using testing::Random;

bool says(const RigidFit& fit, const std::string& words) {
    if (fit.problem.find(words) != std::string::npos) return true;
    return std::any_of(fit.warnings.begin(), fit.warnings.end(),
                       [&](const std::string& w) { return w.find(words) != std::string::npos; });
}

struct Pairs {
    std::vector<Point3> from, to;
    Rigid truth;
    double scale = 1;
};

Pairs pairs(std::size_t count, double noise_mm, Random& random, double scale = 1) {
    Pairs p;
    p.truth = random.rigid(1000);
    p.scale = scale;
    for (std::size_t i = 0; i < count; ++i) {
        p.from.push_back(random.point(200));
        Point3 q = p.truth * Point3{scale * p.from[i].x, scale * p.from[i].y, scale * p.from[i].z};
        for (int c = 0; c < 3; ++c) q[c] += noise_mm * random.gaussian();
        p.to.push_back(q);
    }
    return p;
}

TEST(Landmarks, ExactPairsComeBack) {
    Random random(1);
    for (std::size_t count : {3u, 4u, 8u, 100u}) {
        for (bool with_scale : {false, true}) {
            const Pairs p = pairs(count, 0, random, with_scale ? 1.07 : 1);
            const RigidFit fit = fit_rigid(p.from, p.to, {}, {.fit_scale = with_scale});
            ASSERT_TRUE(fit.determined) << fit.problem;
            for (std::size_t i = 0; i < count; ++i)
                EXPECT_LT(distance(fit.map(p.from[i]), p.to[i]), 1e-9);
            EXPECT_NEAR(fit.scale, p.scale, 1e-12);
            EXPECT_LT(rotation_angle(transpose(fit.to_from.rotation) * p.truth.rotation), 1e-12);
            EXPECT_LT(orthonormality_error(fit.to_from.rotation), 1e-14);
        }
    }
}

TEST(Landmarks, HalfTurnsAndFlatSetsAreNoSpecialCase) {
    testing::HardCase rms("rms of flat sets, half turns among them", testing::HardCase::at_most,
                          1e-9, "mm");
    Random random(2);
    for (int draw = 0; draw < 100; ++draw) {
        Pairs p = pairs(4, 0, random);
        for (Point3& q : p.from) q.z = 0;  // coplanar
        p.truth.rotation = rotation_about(random.direction(), draw % 2 ? kPi : 1e-8);
        for (std::size_t i = 0; i < 4; ++i) p.to[i] = p.truth * p.from[i];
        const RigidFit fit = fit_rigid(p.from, p.to);
        ASSERT_TRUE(fit.determined);
        rms.see(fit.rms_mm);
        EXPECT_GT(determinant(fit.to_from.rotation), 0.999);
    }
}

TEST(Landmarks, TargetSigmaCoversTheTruth) {
    Random random(3);
    double expected = 0, seen = 0;
    for (int draw = 0; draw < 500; ++draw) {
        const Pairs p = pairs(8, 1, random);
        const RigidFit fit = fit_rigid(p.from, p.to);
        const Point3 target{50, -30, 80};
        expected += fit.target_sigma_mm(target) * fit.target_sigma_mm(target);
        const double e = distance(fit.map(target), p.truth * target);
        seen += e * e;
    }
    EXPECT_NEAR(std::sqrt(expected / seen), 1, 0.08);
}

TEST(Landmarks, OneBadPairIsNamed) {
    Random random(4);
    Pairs p = pairs(6, 0.5, random);
    p.to[3] = p.to[3] + Vector3{40, 0, 0};
    const std::vector<std::string> names{"navel",     "xiphoid", "left hip",
                                         "right hip", "sternum", "flank"};
    const RigidFit fit = fit_rigid(p.from, p.to, names);
    EXPECT_TRUE(says(fit, "right hip"));
    EXPECT_EQ(fit.inliers, 5);
    EXPECT_FALSE(fit.used[3]);
    EXPECT_LT(fit.rms_mm, 1.5);
    EXPECT_GT(fit.residuals_mm[3], 30);
}

TEST(Landmarks, ExchangedAndMirroredAreRecognised) {
    Random random(5);
    int exchanged = 0, in_the_mirror = 0;
    for (int draw = 0; draw < 100; ++draw) {
        Pairs p = pairs(6, 0.5, random);
        std::vector<Point3> swapped = p.to;
        std::swap(swapped[1], swapped[2]);
        exchanged += says(fit_rigid(p.from, swapped), "exchanged");
        std::vector<Point3> mirrored = p.from;
        for (Point3& q : mirrored) q.x = -q.x;
        in_the_mirror += says(fit_rigid(mirrored, p.to), "mirror");
        std::vector<Point3> cm = p.from;
        for (Point3& q : cm) q = {q.x / 10, q.y / 10, q.z / 10};
        EXPECT_TRUE(says(fit_rigid(cm, p.to), "scale of"));
        EXPECT_FALSE(says(fit_rigid(p.from, p.to), "exchanged"));
        EXPECT_FALSE(says(fit_rigid(p.from, p.to), "mirror"));
    }
    testing::HardCase two("of 100 sets of six landmarks, two of them exchanged, missed",
                          testing::HardCase::at_most, 0, "");
    two.see(100 - exchanged);
    testing::HardCase mirror("of 100 mirrored ones, missed", testing::HardCase::at_most, 0, "");
    mirror.see(100 - in_the_mirror);
}

TEST(Landmarks, TooFewOnALineAndInOnePlace) {
    Random random(6);
    Pairs p = pairs(5, 0.1, random);
    EXPECT_TRUE(says(fit_rigid(std::span(p.from).first(2), std::span(p.to).first(2)),
                     "2 usable landmarks"));
    std::vector<Point3> line, image;
    for (int i = 0; i < 4; ++i) {
        line.push_back({30.0 * i, 10.0 * i, 0});
        image.push_back(p.truth * line.back());
    }
    const RigidFit fit = fit_rigid(line, image);
    EXPECT_FALSE(fit.determined);
    EXPECT_TRUE(says(fit, "on one line"));
    EXPECT_TRUE(std::isinf(fit.condition));
    EXPECT_TRUE(says(fit_rigid(std::vector<Point3>(4), std::vector<Point3>(4)), "one place"));
    p.to[0].x = NAN;
    EXPECT_TRUE(says(fit_rigid(p.from, p.to), "NaN"));
}

// A torso-like shape: three different half-axes and a bulge, so that no turn maps it on itself.
Surface torso() {
    Surface s;
    for (int i = 0; i <= 60; ++i) {
        for (int j = 0; j < 120; ++j) {
            const double a = kPi * i / 60, b = 2 * kPi * j / 120;
            const double bulge = 1 + 0.25 * std::exp(-8 * ((a - 1) * (a - 1) + (b - 1) * (b - 1))) +
                                 0.1 * std::cos(a);
            s.points.push_back({160 * bulge * std::sin(a) * std::cos(b),
                                110 * bulge * std::sin(a) * std::sin(b), 260 * std::cos(a)});
        }
    }
    for (std::uint32_t i = 0; i < 60; ++i) {
        for (std::uint32_t j = 0; j < 120; ++j) {
            const std::uint32_t a = 120 * i + j, b = 120 * i + (j + 1) % 120;
            s.triangles.push_back({a, a + 120, b});
            s.triangles.push_back({b, a + 120, b + 120});
        }
    }
    return s;
}

std::vector<Point3> swept(
    const Surface& s, const Rigid& truth, double noise_mm, Random& random, double z_low) {
    std::vector<Point3> out;
    while (out.size() < 1000) {
        const auto& t = s.triangles[static_cast<std::size_t>(
            random.uniform(0, static_cast<double>(s.triangles.size())))];
        double u = random.uniform(0, 1), v = random.uniform(0, 1);
        if (u + v > 1) {
            u = 1 - u;
            v = 1 - v;
        }
        const Point3 a = s.points[t[0]];
        Point3 p = a + u * (s.points[t[1]] - a) + v * (s.points[t[2]] - a);
        if (p.z < z_low) continue;
        p = truth * p;
        for (int c = 0; c < 3; ++c) p[c] += noise_mm * random.gaussian();
        out.push_back(p);
    }
    return out;
}

TEST(SkinSweep, StartNearbyEndsOnTheTruth) {
    Random random(7);
    const Surface s = torso();
    const Rigid truth = random.rigid(800);
    const std::vector<Point3> readings = swept(s, truth, 0.5, random, -400);
    SweepOptions options;
    options.has_start = true;
    options.start =
        truth * Rigid{rotation_about(random.direction(), 12 * kRadPerDeg), {15, -10, 12}};
    const RigidFit fit = fit_skin_sweep(s, readings, options);
    ASSERT_TRUE(fit.determined) << fit.problem;
    for (const Point3& p : {Point3{0, 0, 0}, Point3{0, 60, 100}, Point3{80, 0, -100}}) {
        EXPECT_LT(distance(fit.map(p), truth * p), 1.0);
    }
    EXPECT_LT(fit.rms_mm, 1.0);
}

TEST(SkinSweep, NoStartFindsTheTruthOrSaysItIsNotUnique) {
    const Surface s = torso();
    int right = 0;
    for (std::uint64_t seed = 20; seed < 24; ++seed) {
        Random random(seed);
        const Rigid truth = random.rigid(800);
        const RigidFit fit = fit_skin_sweep(s, swept(s, truth, 0.5, random, -400));
        const bool found = distance(fit.map({0, 0, 100}), truth * Point3{0, 0, 100}) < 3;
        right += found;
        EXPECT_TRUE(found || says(fit, "fits the sweep nearly as well") ||
                    says(fit, "rms off the surface"))
            << seed;
    }
    EXPECT_GE(right, 3);
}

TEST(SkinSweep, PatchLeavesASlideAndSaysSo) {
    // Only a cap of a sphere: every turn about the centre fits.
    Random random(9);
    Surface ball;
    for (int i = 0; i < 8000; ++i) {
        const Vector3 d = random.direction();
        ball.points.push_back({150 * d.x, 150 * d.y, 150 * d.z});
        ball.normals.push_back(d);
    }
    std::vector<Point3> readings;
    while (readings.size() < 300) {
        const Vector3 d = random.direction();
        if (d.z > 0.7) readings.push_back({150 * d.x, 150 * d.y, 150 * d.z});
    }
    SweepOptions options;
    options.has_start = true;
    const RigidFit fit = fit_skin_sweep(ball, readings, options);
    EXPECT_FALSE(fit.determined && fit.warnings.empty());
    EXPECT_TRUE(says(fit, "sweep"));
    testing::HardCase condition("condition of a fit that slides", testing::HardCase::at_least, 50,
                                "");
    condition.see(fit.condition);
}

TEST(SkinSweep, TooFewReadingsAndNoSurface) {
    const Surface s = torso();
    EXPECT_TRUE(says(fit_skin_sweep(s, std::vector<Point3>(5)), "5 usable readings"));
    EXPECT_TRUE(says(fit_skin_sweep(Surface{}, std::vector<Point3>(50)), "0 points"));
}

}  // namespace
}  // namespace sonocase
