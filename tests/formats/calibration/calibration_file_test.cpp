// SPDX-License-Identifier: Apache-2.0

#include <gtest/gtest.h>

#include "formats/calibration/calibration.h"
#include "support/random.h"

namespace sonocase {
namespace {

TEST(CalibrationFile, ComesBackAsItWas) {
    testing::Random random(9);
    Calibration c;
    c.kind = "needle";
    c.sensor = "VP-0042";
    c.sensor_from_tool = random.rigid(100);
    c.rms_mm = 0.4;
    c.sigma_mm = {0.1, 0.2, INFINITY};
    c.condition = 12.5;
    c.poses = 200;
    c.date = "2026-03-01T12:00:00Z";
    c.data_digest = "00ff";
    c.warnings = {"Turn the tool about more than one axis."};
    const auto back = parse_calibration(format_calibration(c), "c.json");
    ASSERT_TRUE(back) << back.error().message();
    EXPECT_EQ(back->kind, c.kind);
    EXPECT_EQ(back->sensor, c.sensor);
    EXPECT_EQ(back->sensor_from_tool, c.sensor_from_tool);
    EXPECT_EQ(back->rms_mm, c.rms_mm);
    EXPECT_EQ(back->sigma_mm, c.sigma_mm);
    EXPECT_EQ(back->condition, c.condition);
    EXPECT_EQ(back->poses, 200);
    EXPECT_EQ(back->date, c.date);
    EXPECT_EQ(back->warnings, c.warnings);
}

TEST(CalibrationFile, AMirrorIsNoRotationAndAnUnknownKindIsNamed) {
    Calibration c;
    c.kind = "probe";
    c.sensor_from_tool.rotation = Matrix3::diagonal({1, 1, -1});
    EXPECT_FALSE(parse_calibration(format_calibration(c), "c.json"));
    c.sensor_from_tool = {};
    c.kind = "prob";
    const auto wrong = parse_calibration(format_calibration(c), "c.json");
    ASSERT_FALSE(wrong);
    EXPECT_NE(wrong.error().message().find("prob"), std::string::npos);
}

}  // namespace
}  // namespace sonocase
