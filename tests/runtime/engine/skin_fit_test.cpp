// SPDX-License-Identifier: Apache-2.0

// Where the engine says that skin was not fitted.
#include "runtime/engine/skin.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "runtime/engine/scan_engine.h"
#include "support/hard_case.h"
#include "support/small_case.h"

namespace sonocase::runtime {
namespace {

// Skin on a cylinder of 60 mm about y; the half with x < 0 was not fitted.
CaseBundle half_fitted() {
    CaseBundle bundle = sonocase::testing::small_case();
    bundle.patient_skin = {};
    for (int a = 0; a < 72; ++a) {
        for (int n = -20; n <= 20; ++n) {
            const double angle = a * 0.0872664626;
            bundle.patient_skin.points.push_back(
                {60 * std::cos(angle), 5.0 * n, 60 * std::sin(angle)});
            bundle.skin_unfitted.push_back(std::cos(angle) < 0);
        }
    }
    return bundle;
}

TEST(SkinFit, IsReadFromTheNearestSkin) {
    const CaseBundle bundle = half_fitted();
    const SkinFit fit(bundle);
    int wrong = 0;
    for (int n = 0; n < 24; ++n) {
        const double angle = n * 0.261799388;
        const double x = std::cos(angle);
        if (std::abs(x) < 0.4) continue;  // within 24 mm of the border the votes are mixed
        // The probe's face lies a little above the skin, or is pressed in.
        for (const double radius : {52.0, 60.0, 68.0})
            wrong += fit.not_fitted({radius * x, 10, radius * std::sin(angle)}) != (x < 0);
    }
    testing::HardCase places("of 54 places on the skin and 8 mm off it, called otherwise",
                             testing::HardCase::at_most, 0, "");
    places.see(wrong);
    EXPECT_FALSE(fit.not_fitted({-200, 0, 0}));
    EXPECT_FALSE(fit.not_fitted({-60, 1e300, 0}));
    EXPECT_FALSE(fit.not_fitted({std::numeric_limits<double>::quiet_NaN(), 0, 0}));
}

TEST(SkinFit, IsFittedEverywhereWhereTheBundleSaysNothing) {
    CaseBundle bundle = half_fitted();
    bundle.skin_unfitted.clear();
    EXPECT_FALSE(SkinFit(bundle).not_fitted({-60, 0, 0}));
    bundle.patient_skin = {};
    EXPECT_FALSE(SkinFit(bundle).not_fitted({-60, 0, 0}));
    EXPECT_FALSE(SkinFit().not_fitted({-60, 0, 0}));
}

TEST(SkinFit, FramesOfAProbeOnUnfittedSkinSaySo) {
    const CaseBundle bundle = half_fitted();
    Exercise exercise;
    EngineOptions options;
    options.render.width_px = options.render.height_px = 64;
    auto engine = ScanEngine::create(bundle, exercise, options);
    ASSERT_TRUE(engine) << engine.error().message();
    std::vector<std::uint8_t> pixels(64 * 64);
    for (const double side : {1.0, -1.0}) {
        for (const double height : {60.0, 90.0}) {
            TrackerReading reading;
            reading.in_mannequin = true;
            reading.sensor_count = 1;
            reading.sequence = 1;
            Rigid pose;
            // Beam (z of the probe) towards the axis, face on the skin or in the air.
            const Vector3 z{-side, 0, 0}, x{0, 1, 0};
            pose.rotation = Matrix3::from_columns(x, cross(z, x), z);
            pose.translation = {side * height, 0, 0};
            reading.sensors[kProbeSensor] = {SensorState::ok, pose, 1.0f, 0};
            engine->observe(reading, false);
            const FrameStatus status = engine->frame(0, {}, pixels);
            EXPECT_EQ(status == FrameStatus::rendered, height < 61);
            EXPECT_EQ(engine->last().skin_not_fitted, side < 0 && height < 61) << side << height;
        }
    }
}

}  // namespace
}  // namespace sonocase::runtime
