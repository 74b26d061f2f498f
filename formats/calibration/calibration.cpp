// SPDX-License-Identifier: Apache-2.0

#include "formats/calibration/calibration.h"

#include <algorithm>
#include <cmath>

#include "formats/calibration/report_text.h"
#include "formats/text/json_reader.h"

namespace sonocase {
namespace {

using detail::Json;
using detail::JsonFault;
using detail::JsonObject;

constexpr const char* kFormat = "sonocase calibration";
constexpr std::int64_t kVersion = 1;

}  // namespace

std::string format_calibration(const Calibration& c) {
    Json out = Json::object();
    out["format"] = kFormat;
    out["version"] = kVersion;
    out["kind"] = c.kind;
    out["sensor"] = c.sensor;
    out["sensor_from_tool"] = detail::json_of(c.sensor_from_tool);
    out["scale"] = c.scale;
    out["rms_mm"] = detail::json_number(c.rms_mm);
    out["sigma_mm"] =
        Json::array({detail::json_number(c.sigma_mm.x), detail::json_number(c.sigma_mm.y),
                     detail::json_number(c.sigma_mm.z)});
    out["condition"] = detail::json_number(c.condition);
    out["poses"] = c.poses;
    out["date"] = c.date;
    out["data_digest"] = c.data_digest;
    out["warnings"] = c.warnings;
    return detail::json_text(out, true) + "\n";
}

Result<Calibration> parse_calibration(std::string_view json, const std::string& where) {
    Json value;
    JsonFault fault{where, {}};
    if (!detail::parse_json(json, value, fault)) return *fault.error;
    JsonObject object(value, "", fault);
    detail::expect_format(object, kFormat, kVersion, "calibrate");
    Calibration c;
    c.kind = object.text("kind");
    if (c.kind != "probe" && c.kind != "needle" && c.kind != "mannequin") {
        object.add_fault("kind", "'" + c.kind + "' is not known", "probe, needle or mannequin");
    }
    c.sensor = object.text_or("sensor", "");
    c.sensor_from_tool = detail::rigid_from(object.object("sensor_from_tool"));
    c.scale = object.number_or("scale", 1);
    if (!(c.scale > 0)) object.add_fault("scale", "is not above zero");
    c.rms_mm = object.number_or("rms_mm", -1);
    // null stands for an infinite standard deviation (an undetermined direction).
    if (const auto sigma = value.find("sigma_mm");
        sigma != value.end() && sigma->is_array() && sigma->size() == 3) {
        for (std::size_t a = 0; a < 3; ++a) {
            const Json& item = (*sigma)[a];
            c.sigma_mm[static_cast<int>(a)] =
                item.is_number() ? item.get<double>() : std::numeric_limits<double>::infinity();
        }
    }
    c.condition =
        object.has("condition")
            ? object.number("condition")
            : (value.contains("condition") ? std::numeric_limits<double>::infinity() : -1);
    c.poses = static_cast<int>(object.integer_or("poses", 0, 0, INT32_MAX));
    c.date = object.text_or("date", "");
    c.data_digest = object.text_or("data_digest", "");
    c.warnings = object.texts_or_none("warnings");
    if (fault.error) return *fault.error;
    return c;
}

Result<std::optional<double>> parse_lag_s(std::string_view json, const std::string& where) {
    Json value;
    JsonFault fault{where, {}};
    if (!detail::parse_json(json, value, fault) || !value.is_object())
        return std::optional<double>{};
    const auto kind = value.find("sonocase");
    if (kind == value.end() || *kind != "lag") return std::optional<double>{};
    JsonObject object(value, "", fault);
    const double lag_s = object.number("lag_s");
    if (fault.error) return *fault.error;
    return std::optional<double>(lag_s);
}

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

std::vector<Message> calibration_concerns(const Calibration& c,
                                          std::string_view now,
                                          const CalibrationLimits& limits) {
    using calibrate::text;
    std::vector<Message> out;
    const Message what("The {} calibration", {c.kind});
    double made = 0, today = 0;
    if (!days_from_iso_date(c.date, &made)) {
        out.push_back({"{} has no date; calibrate again to be sure.", {what}});
    } else if (days_from_iso_date(now, &today)) {
        if (made > today + 1) {
            out.push_back(
                {"{} is dated in the future ({}); check this machine's clock.", {what, c.date}});
        } else if (today - made > limits.max_age_days) {
            out.push_back(
                {"{} is {} days old; calibrate again.", {what, text("%.0f", today - made)}});
        }
    }
    if (c.rms_mm < 0) {
        out.push_back({"{} does not say how well it fitted; calibrate again.", {what}});
    } else if (c.rms_mm > limits.max_rms_mm) {
        out.push_back({"{} fits its readings only to {} mm rms; calibrate again.",
                       {what, text("%.1f", c.rms_mm)}});
    }
    const double sigma = std::max({c.sigma_mm.x, c.sigma_mm.y, c.sigma_mm.z});
    if (!std::isfinite(sigma) || sigma > limits.max_sigma_mm) {
        out.push_back({"{} is accurate only to {} mm; calibrate again with more and wider motion.",
                       {what, text("%.1f", sigma)}});
    }
    if (!std::isfinite(c.condition) || c.condition > limits.max_condition) {
        out.push_back(
            {"{} comes from a motion that hardly determines it (condition {}); calibrate again, "
             "tilting in every direction.",
             {what, text("%.0f", c.condition)}});
    }
    if (c.kind != "mannequin" && c.poses > 0 && c.poses < limits.min_poses) {
        out.push_back(
            {"{} comes from only {} readings; take 30 or more.", {what, std::to_string(c.poses)}});
    }
    if (orthonormality_error(c.sensor_from_tool.rotation) > 1e-6 ||
        !is_finite(c.sensor_from_tool)) {
        out.push_back({"{} does not hold a proper rotation; calibrate again.", {what}});
    }
    if (!(c.scale > 0.5 && c.scale < 2)) {
        out.push_back({"{} has a scale of {}; check the units.", {what, text("%.3g", c.scale)}});
    }
    return out;
}

}  // namespace sonocase
