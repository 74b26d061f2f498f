// SPDX-License-Identifier: Apache-2.0

#include "runtime/player/session/calibration_set.h"

#include <gtest/gtest.h>

namespace sonocase::runtime {
namespace {

TEST(CalibrationWarnings, NameACalibrationOfAnotherSensorAndAnOldOne) {
    Calibrations calibrations;
    calibrations.probe.emplace();
    calibrations.probe->kind = "probe";
    calibrations.probe->sensor = "Polhemus Viper (SN 1)";
    calibrations.probe->rms_mm = 0.5;
    calibrations.probe->sigma_mm = {0.1, 0.1, 0.1};
    calibrations.probe->condition = 5;
    calibrations.probe->poses = 100;
    calibrations.probe->date = "2026-01-01T00:00:00Z";
    EXPECT_TRUE(calibration_warnings(calibrations, "Polhemus Viper (SN 1)", "2026-01-02T00:00:00Z")
                    .empty());
    calibrations.probe->warnings = {"ProbeFace is the probe."};
    EXPECT_EQ(calibration_warnings(calibrations, "", "2026-01-02T00:00:00Z").front(),
              "Calibration of the probe: ProbeFace is the probe.");
    calibrations.probe->warnings.clear();
    EXPECT_EQ(
        calibration_warnings(calibrations, "Polhemus Viper (SN 2)", "2026-01-02T00:00:00Z").size(),
        1u);
    EXPECT_EQ(
        calibration_warnings(calibrations, "Polhemus Viper (SN 1)", "2026-06-02T00:00:00Z").size(),
        1u);
}

TEST(CalibrationSet, NewerOnesReplaceThoseInUseAndTheLagStays) {
    Calibrations in_use, newer;
    in_use.probe.emplace().rms_mm = 1;
    in_use.needle.emplace().rms_mm = 1;
    in_use.needle_lag_s = 0.02;
    newer.probe.emplace().rms_mm = 2;
    merge_calibrations(newer, in_use);
    EXPECT_EQ(in_use.probe->rms_mm, 2);
    EXPECT_EQ(in_use.needle->rms_mm, 1);
    EXPECT_FALSE(in_use.mannequin);
    EXPECT_EQ(in_use.needle_lag_s, 0.02);
}

}  // namespace
}  // namespace sonocase::runtime
