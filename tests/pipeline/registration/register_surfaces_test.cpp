#include "pipeline/registration/register_surfaces.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "pipeline/import/analytic_torso.h"
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
    EXPECT_LT(error.mean, 2.0);
    EXPECT_LT(error.p95, 4.0);
    EXPECT_LT(error.mean, target_error(rigid, truth).mean);
    EXPECT_LT(result->fit.rms_mm, 0.9);  // the noise is 0.7
    EXPECT_GT(result->registration.min_det_jacobian, 0.2);
}

}  // namespace
}  // namespace sonocase::pipeline
