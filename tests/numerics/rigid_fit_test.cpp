// SPDX-License-Identifier: Apache-2.0

// Rigid fit of pairs: limits of angle, shape and scale.
#include <gtest/gtest.h>

#include <cmath>

#include "formats/base/constants.h"
#include "formats/calibration/landmarks.h"
#include "numerics/property.h"
#include "support/hard_case.h"

namespace sonocase::numerics {
namespace {

using testing::HardCase;

struct Shape {
    std::vector<Point3> points;
    double width = 1;  // of the second longest axis over the longest
};

Shape shape(testing::Random& random, int kind) {
    Shape s;
    const int count = 3 + static_cast<int>(random.uniform(0, 20));
    const double flat = kind == 0 ? 1 : 0;                              // coplanar unless kind 0
    s.width = kind == 2 ? std::pow(10.0, random.uniform(-1.3, 0)) : 1;  // nearly on a line
    for (int i = 0; i < count; ++i) {
        s.points.push_back(
            {random.gaussian(), s.width * random.gaussian(), flat * random.gaussian()});
    }
    if (kind == 3) s.points.insert(s.points.end(), s.points.begin(), s.points.end());  // repeated
    return s;
}

struct ExactPairs {
    bool determined = false;                        // a shape that is a line by chance is not
    double angle = 0, rms = 0, orthonormality = 0;  // errors over their bounds
    double turn = 0;                                // determinant
};

ExactPairs exact_pairs(testing::Random random) {
    const int kind = static_cast<int>(random.uniform(0, 3.999));
    const Shape s = shape(random, kind);
    const double size = std::pow(10.0, random.uniform(0.5, 5)),
                 away = std::pow(10.0, random.uniform(0, 6));
    const int limit = static_cast<int>(random.uniform(0, 3.999));
    const double angle = limit == 0   ? 0
                         : limit == 1 ? kPi
                         : limit == 2 ? 1e-9
                                      : random.uniform(0, kPi);
    Rigid truth{nearest_rotation(rotation_about(random.direction(), angle)),
                away * random.direction()};
    std::vector<Point3> from, to;
    for (const Point3& p : s.points) {
        from.push_back({size * p.x, size * p.y, size * p.z});
        to.push_back(truth * from.back());
    }
    const RigidFit fit = fit_rigid(from, to);
    // Rounding of stored coordinates over the narrower side of the shape.
    const double angle_bound = 300 * kEpsilon * (size + away) / (size * s.width);
    return {fit.determined,
            rotation_angle(transpose(fit.to_from.rotation) * truth.rotation) /
                (20 * angle_bound / s.width),
            fit.rms_mm / (300 * kEpsilon * (size + away)),
            orthonormality_error(fit.to_from.rotation) / 1e-14, determinant(fit.to_from.rotation)};
}

RC_GTEST_PROP(RigidFitNumerics, ExactPairsComeBackAtEveryAngleShapeAndScale, ()) {
    const ExactPairs e = exact_pairs(random_case());
    RC_PRE(e.determined);
    RC_ASSERT(e.angle <= 1);
    RC_ASSERT(e.rms <= 1);
    RC_ASSERT(e.orthonormality < 1);
    RC_ASSERT(e.turn > 0);
}

TEST(RigidFitNumerics, ExactPairsOfAThousandShapesOverTheirBounds) {
    HardCase angle("angle over its bound, a thousand shapes", HardCase::at_most, 1, "");
    HardCase rms("rms over its bound, a thousand shapes", HardCase::at_most, 1, "");
    for (std::uint64_t seed = 1; seed <= 1000; ++seed) {
        const ExactPairs e = exact_pairs(testing::Random(seed));
        if (!e.determined) continue;
        angle.see(e.angle);
        rms.see(e.rms);
    }
}

RC_GTEST_PROP(RigidFitNumerics, NoiseMovesTheFitAsItsSigmaSays, ()) {
    testing::Random random = random_case();
    const Rigid truth = random.rigid(500);
    double ratio = 0;
    constexpr int kDraws = 60;
    for (int draw = 0; draw < kDraws; ++draw) {
        std::vector<Point3> from, to;
        for (int i = 0; i < 12; ++i) {
            from.push_back(random.point(150));
            const Point3 p = truth * from.back();
            to.push_back(
                {p.x + random.gaussian(), p.y + random.gaussian(), p.z + random.gaussian()});
        }
        const RigidFit fit = fit_rigid(from, to, {}, {.reject_outliers = false});
        const Point3 target{100, 0, 50};
        const double e = distance(fit.map(target), truth * target) / fit.target_sigma_mm(target);
        ratio += e * e / kDraws;
    }
    // Chi-square of 3 kDraws degrees over 3 kDraws, and sigma itself estimated from 30: +-0.45 is
    // over four sigmas.
    RC_ASSERT(std::abs(ratio - 1) < 0.55);
}

RC_GTEST_PROP(RigidFitNumerics, SwappingTheSidesInvertsTheMotion, ()) {
    testing::Random random = random_case();
    const Rigid truth = random.rigid(500);
    std::vector<Point3> from, to;
    for (int i = 0; i < 10; ++i) {
        from.push_back(random.point(150));
        const Point3 p = truth * from.back();
        to.push_back({p.x + random.gaussian(), p.y + random.gaussian(), p.z + random.gaussian()});
    }
    const RigidFit there = fit_rigid(from, to, {}, {.reject_outliers = false});
    const RigidFit back = fit_rigid(to, from, {}, {.reject_outliers = false});
    const Rigid loop = there.to_from * back.to_from;
    RC_ASSERT(rotation_angle(loop.rotation) < 1e-12);
    RC_ASSERT(norm(loop.translation) < 1e-9);
}

TEST(RigidFitNumerics, AMirrorIsNeverTheAnswer) {
    testing::Random random(1);
    HardCase turn("determinant of the answer to a mirror", HardCase::at_least, 0.999, "");
    for (int draw = 0; draw < 50; ++draw) {
        std::vector<Point3> from, to;
        for (int i = 0; i < 6; ++i) {
            from.push_back(random.point(100));
            to.push_back({-from.back().x, from.back().y, from.back().z});
        }
        turn.see(determinant(fit_rigid(from, to).to_from.rotation));
    }
}

TEST(RigidFitNumerics, GuardForALineFiresAndNamesIt) {
    std::vector<Point3> line;
    for (int i = 0; i < 5; ++i) line.push_back({10.0 * i, 20.0 * i, 0});
    const RigidFit fit = fit_rigid(line, line);
    EXPECT_FALSE(fit.determined);
    EXPECT_NE(fit.problem.find("one line"), std::string::npos);
}

}  // namespace
}  // namespace sonocase::numerics
