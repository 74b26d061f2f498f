// SPDX-License-Identifier: Apache-2.0

#include "formats/calibration/quality.h"

#include <algorithm>
#include <cmath>

#include "formats/calibration/report_text.h"

namespace sonocase {

bool days_from_iso_date(std::string_view t, double* days) {
    const auto number = [&](std::size_t at, std::size_t count, int* value) {
        if (t.size() < at + count) return false;
        *value = 0;
        for (std::size_t i = at; i < at + count; ++i) {
            if (t[i] < '0' || t[i] > '9') return false;
            *value = 10 * *value + (t[i] - '0');
        }
        return true;
    };
    int y = 0, m = 0, d = 0, hour = 0, minute = 0, second = 0;
    if (!number(0, 4, &y) || !number(5, 2, &m) || !number(8, 2, &d)) return false;
    if (t[4] != '-' || t[7] != '-' || m < 1 || m > 12 || d < 1 || d > 31) return false;
    if (t.size() > 10) {
        if (t[10] != 'T' && t[10] != ' ') return false;
        if (!number(11, 2, &hour) || !number(14, 2, &minute)) return false;
        number(17, 2, &second);
    }
    // Days of the civil calendar, counted in years that begin in March.
    const int year = m <= 2 ? y - 1 : y, month = (m + 9) % 12;
    const int era = year / 400, of_era = year - 400 * era;
    const int of_year = (153 * month + 2) / 5 + d - 1;
    const int whole = era * 146097 + of_era * 365 + of_era / 4 - of_era / 100 + of_year - 719468;
    *days = whole + hour / 24.0 + minute / 1440.0 + second / 86400.0;
    return true;
}

std::vector<std::string> calibration_concerns(const Calibration& c,
                                              std::string_view now,
                                              const CalibrationLimits& limits) {
    using calibrate::text;
    std::vector<std::string> out;
    const std::string what = "The " + c.kind + " calibration";
    double made = 0, today = 0;
    if (!days_from_iso_date(c.date, &made)) {
        out.push_back(what + " has no date; calibrate again to be sure.");
    } else if (days_from_iso_date(now, &today)) {
        if (made > today + 1) {
            out.push_back(what + " is dated in the future (" + c.date +
                          "); check this machine's clock.");
        } else if (today - made > limits.max_age_days) {
            out.push_back(what + text(" is %.0f days old; calibrate again.", today - made));
        }
    }
    if (c.rms_mm < 0) {
        out.push_back(what + " does not say how well it fitted; calibrate again.");
    } else if (c.rms_mm > limits.max_rms_mm) {
        out.push_back(what +
                      text(" fits its readings only to %.1f mm rms; calibrate again.", c.rms_mm));
    }
    const double sigma = std::max({c.sigma_mm.x, c.sigma_mm.y, c.sigma_mm.z});
    if (!std::isfinite(sigma) || sigma > limits.max_sigma_mm) {
        out.push_back(
            what + text(" is accurate only to %.1f mm; calibrate again with more and wider motion.",
                        sigma));
    }
    if (!std::isfinite(c.condition) || c.condition > limits.max_condition) {
        out.push_back(
            what +
            text(" comes from a motion that hardly determines it (condition %.0f); calibrate "
                 "again, tilting in every direction.",
                 c.condition));
    }
    if (c.kind != "mannequin" && c.poses > 0 && c.poses < limits.min_poses) {
        out.push_back(what + text(" comes from only %d readings; take 30 or more.", c.poses));
    }
    if (orthonormality_error(c.sensor_from_tool.rotation) > 1e-6 ||
        !is_finite(c.sensor_from_tool)) {
        out.push_back(what + " does not hold a proper rotation; calibrate again.");
    }
    if (!(c.scale > 0.5 && c.scale < 2)) {
        out.push_back(what + text(" has a scale of %.3g; check the units.", c.scale));
    }
    return out;
}

}  // namespace sonocase
