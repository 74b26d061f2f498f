// SPDX-License-Identifier: Apache-2.0

// A saved calibration (JSON): which sensor, what was found, how good it is.
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "formats/base/geometry.h"
#include "formats/base/result.h"

namespace sonocase {

// kind "probe":      sensor_from_tool = probe_sensor_from_probe (origin and axes of the probe
// frame) kind "needle":     sensor_from_tool = needle_sensor_from_needle (origin at the tip, z hub
// to tip) kind "mannequin":  sensor_from_tool = world_from_mannequin, scale applied to the
// mannequin first
struct Calibration {
    std::string kind;
    std::string sensor;  // serial or name; empty: unknown
    Rigid sensor_from_tool;
    double scale = 1;
    double rms_mm = -1;            // negative: not measured
    Vector3 sigma_mm{-1, -1, -1};  // one standard deviation of the translation
    double condition = -1;
    int poses = 0;
    std::string date;         // ISO 8601, UTC; given by the caller
    std::string data_digest;  // of the readings
    std::vector<std::string> warnings;
};

Result<Calibration> parse_calibration(std::string_view json, const std::string& where);
std::string format_calibration(const Calibration& calibration);

// What sonocase calibrate lag saves: the second recording shows a motion lag_s later than the
// first. Nothing where the text is no such file; an Error where it is one and holds no finite lag.
Result<std::optional<double>> parse_lag_s(std::string_view json, const std::string& where);

}  // namespace sonocase
