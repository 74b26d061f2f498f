// SPDX-License-Identifier: Apache-2.0

// A saved calibration (JSON): which sensor, what was found, how good it is, and what to tell the
// user before relying on it.
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "formats/base/geometry.h"
#include "formats/base/result.h"

namespace sonocase {

// kind         sensor_from_tool
// "probe"      probe_sensor_from_probe: origin and axes of the probe frame
// "needle"     needle_sensor_from_needle: origin at the tip, z from hub to tip
// "mannequin"  world_from_mannequin; the scale is applied to the mannequin first
struct Calibration {
    std::string kind;
    std::string sensor;  // serial or name; empty: unknown
    Rigid sensor_from_tool;
    double scale = 1;
    double rms_mm = -1;            // negative: not measured
    Vector3 sigma_mm{-1, -1, -1};  // one standard deviation of the translation
    double condition = -1;         // negative: not measured
    int poses = 0;
    std::string date;         // ISO 8601, UTC; given by the caller
    std::string data_digest;  // of the readings
    std::vector<std::string> warnings;
};

Result<Calibration> parse_calibration(std::string_view json, const std::string& where);
std::string format_calibration(const Calibration& calibration);

// Reads what `sonocase calibrate lag` saves: the second recording shows a motion lag_s later than
// the first. Empty if the text is not such a file; an Error if it is one without a finite lag.
Result<std::optional<double>> parse_lag_s(std::string_view json, const std::string& where);

// Limits beyond which calibration_concerns() reports a calibration.
struct CalibrationLimits {
    double max_rms_mm = 2;
    double max_sigma_mm = 1;
    double max_condition = 100;
    double max_age_days = 30;
    int min_poses = 20;  // probe and needle
};

// Whole sentences, each with what to do; empty if there is nothing to report. `now` and the
// calibration's date are ISO 8601 in UTC ("2026-11-21T02:00:00Z"); an unreadable date is a concern
// of its own.
std::vector<Message> calibration_concerns(const Calibration& calibration,
                                          std::string_view now,
                                          const CalibrationLimits& limits = {});

// Days since 1970-01-01, with a fraction; false if the text is not an ISO 8601 date.
bool days_from_iso_date(std::string_view text, double* days);

}  // namespace sonocase
