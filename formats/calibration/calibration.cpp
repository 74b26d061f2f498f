// SPDX-License-Identifier: Apache-2.0

#include "formats/calibration/calibration.h"

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
        object.complain("kind", "'" + c.kind + "' is not known", "probe, needle or mannequin");
    }
    c.sensor = object.text_or("sensor", "");
    c.sensor_from_tool = detail::rigid_from(object.object("sensor_from_tool"));
    c.scale = object.number_or("scale", 1);
    if (!(c.scale > 0)) object.complain("scale", "is not above zero");
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

}  // namespace sonocase
