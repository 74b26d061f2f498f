// SPDX-License-Identifier: Apache-2.0

// Rigid fit of pairs: limits of angle, shape and scale.
#include <gtest/gtest.h>

#include <cmath>

#include "formats/base/constants.h"
#include "formats/calibration/landmarks.h"
#include "numerics/property.h"

namespace sonocase::numerics {
namespace {

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

RC_GTEST_PROP(RigidFitNumerics, ExactPairsComeBackAtEveryAngleShapeAndScale, ()) {
    testing::Random random = random_case();
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
    RC_PRE(fit.determined);  // a shape that is a line by chance is not
    // Rounding of stored coordinates over the narrower side of the shape.
    const double angle_bound = 300 * kEpsilon * (size + away) / (size * s.width);
    RC_ASSERT(rotation_angle(transpose(fit.to_from.rotation) * truth.rotation) <=
              20 * angle_bound / s.width);
    RC_ASSERT(fit.rms_mm <= 300 * kEpsilon * (size + away));
    RC_ASSERT(orthonormality_error(fit.to_from.rotation) < 1e-14);
    RC_ASSERT(determinant(fit.to_from.rotation) > 0);
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
    for (int draw = 0; draw < 50; ++draw) {
        std::vector<Point3> from, to;
        for (int i = 0; i < 6; ++i) {
            from.push_back(random.point(100));
            to.push_back({-from.back().x, from.back().y, from.back().z});
        }
        EXPECT_GT(determinant(fit_rigid(from, to).to_from.rotation), 0.999);
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
