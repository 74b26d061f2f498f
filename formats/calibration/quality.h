// SPDX-License-Identifier: Apache-2.0

// What to tell the user about a saved calibration before relying on it.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "formats/calibration/calibration.h"

namespace sonocase {

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
std::vector<std::string> calibration_concerns(const Calibration& calibration,
                                              std::string_view now,
                                              const CalibrationLimits& limits = {});

// Days since 1970-01-01, with a fraction; false if the text is not an ISO 8601 date.
bool days_from_iso_date(std::string_view text, double* days);

}  // namespace sonocase
