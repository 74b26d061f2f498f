// SPDX-License-Identifier: Apache-2.0

#include "formats/registration/registration_json.h"

#include "formats/text/json_reader.h"
#include "formats/text/stage_report_json.h"

namespace sonocase {
namespace {

using detail::Json;
using detail::JsonFault;
using detail::JsonObject;

constexpr const char* kFormat = "sonocase registration";
constexpr std::int64_t kVersion = 1;
constexpr double kMaxControls = 1e7;

DisplacementGrid residual_from(JsonObject object) {
    DisplacementGrid grid;
    const std::vector<double> size = object.numbers("size", 3);
    double count = 1;
    for (int a = 0; a < 3; ++a) {
        const double n = size[static_cast<std::size_t>(a)];
        // Fewer than four control points hold no cell.
        if (n != std::floor(n) || n < 4 || n > 4096) {
            object.complain("size", "is out of range", "expected whole numbers from 4 to 4096");
            return grid;
        }
        grid.size[a] = static_cast<std::int32_t>(n);
        count *= n;
    }
    if (count > kMaxControls)
        object.complain("size", "is too large", "expected at most 1e7 control points");
    grid.origin_mm = object.point("origin_mm");
    grid.spacing_mm = object.number("spacing_mm");
    if (!(grid.spacing_mm > 0)) object.complain("spacing_mm", "is not above zero");
    if (!object.ok()) return grid;
    const std::vector<double> values =
        object.numbers("control_mm", static_cast<std::size_t>(3 * count));
    if (!object.ok()) return grid;
    grid.control_mm.resize(static_cast<std::size_t>(count));
    for (std::size_t i = 0; i < grid.control_mm.size(); ++i) {
        grid.control_mm[i] = {values[3 * i], values[3 * i + 1], values[3 * i + 2]};
    }
    return grid;
}

}  // namespace

std::string format_registration(const Registration& registration) {
    Json out = Json::object();
    out["format"] = kFormat;
    out["version"] = kVersion;
    out["mannequin_from_ct"] = detail::json_of(registration.mannequin_from_ct);
    Json quadratic = Json::object();
    quadratic["centre_mm"] = detail::json_of(registration.quadratic.centre_mm);
    quadratic["scale_mm"] = registration.quadratic.scale_mm;
    quadratic["coefficients_mm"] = registration.quadratic.coefficients;
    out["quadratic"] = std::move(quadratic);
    if (registration.residual.empty()) {
        out["residual"] = nullptr;
    } else {
        const DisplacementGrid& grid = registration.residual;
        Json residual = Json::object();
        residual["size"] = Json::array({grid.size.x, grid.size.y, grid.size.z});
        residual["origin_mm"] = detail::json_of(grid.origin_mm);
        residual["spacing_mm"] = grid.spacing_mm;
        Json control = Json::array();
        for (const Vector3& v : grid.control_mm) {
            for (int a = 0; a < 3; ++a) control.push_back(v[a]);
        }
        residual["control_mm"] = std::move(control);
        out["residual"] = std::move(residual);
    }
    if (registration.ct_box.empty()) {
        out["ct_box"] = nullptr;
    } else {
        Json box = Json::object();
        box["lower_mm"] = detail::json_of(registration.ct_box.lower);
        box["upper_mm"] = detail::json_of(registration.ct_box.upper);
        out["ct_box"] = std::move(box);
    }
    out["min_det_jacobian"] = detail::json_number(registration.min_det_jacobian);
    out["stages"] = detail::json_of(registration.reports);
    return detail::json_text(out, true) + "\n";
}

Result<Registration> parse_registration(std::string_view json, const std::string& where) {
    Json value;
    JsonFault fault{where, {}};
    if (!detail::parse_json(json, value, fault)) return *fault.error;
    JsonObject object(value, "", fault);
    detail::expect_format(object, kFormat, kVersion, "register");
    Registration registration;
    registration.mannequin_from_ct = detail::rigid_from(object.object("mannequin_from_ct"));
    JsonObject quadratic = object.object("quadratic");
    registration.quadratic.centre_mm = quadratic.point("centre_mm");
    registration.quadratic.scale_mm = quadratic.number("scale_mm");
    if (registration.quadratic.scale_mm == 0) quadratic.complain("scale_mm", "is zero");
    if (object.ok()) {
        const Json& rows = value["quadratic"].contains("coefficients_mm")
                               ? value["quadratic"]["coefficients_mm"]
                               : Json();
        bool good = rows.is_array() && rows.size() == 3;
        for (std::size_t r = 0; good && r < 3; ++r) {
            good = rows[r].is_array() && rows[r].size() == 10;
            for (std::size_t c = 0; good && c < 10; ++c) {
                good = rows[r][c].is_number();
                if (good) registration.quadratic.coefficients[r][c] = rows[r][c].get<double>();
            }
        }
        if (!good)
            quadratic.complain("coefficients_mm", "has the wrong shape",
                               "expected 3 lists of 10 numbers");
    }
    if (object.has("residual")) registration.residual = residual_from(object.object("residual"));
    if (object.has("ct_box")) {
        JsonObject box = object.object("ct_box");
        registration.ct_box.lower = box.point("lower_mm");
        registration.ct_box.upper = box.point("upper_mm");
    }
    registration.min_det_jacobian = object.number_or("min_det_jacobian", 0);
    registration.reports = detail::reports_from(object, "stages");
    if (fault.error) return *fault.error;
    return registration;
}

}  // namespace sonocase
