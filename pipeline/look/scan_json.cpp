// SPDX-License-Identifier: Apache-2.0

#include "formats/text/json_reader.h"
#include "pipeline/look/find_scan.h"

namespace sonocase::pipeline {
namespace {

void expect_between(
    detail::JsonObject& json, const char* key, double value, double low, double high) {
    if (value >= low && value <= high) return;
    json.complain(key, "is out of range",
                  "expected " + std::to_string(low) + " to " + std::to_string(high));
}

void read_fan(detail::JsonObject& json, ScanPlace& place) {
    const auto apex = json.numbers("apex_px", 2);
    const double inner = json.number("r_in_mm"), outer = json.number("r_out_mm");
    const double degrees = json.number("half_angle_deg");
    if (!json.ok()) return;
    expect_between(json, "half_angle_deg", degrees, 1, 89);
    expect_between(json, "r_in_mm", inner, 0, 1000);
    expect_between(json, "r_out_mm", outer, inner + 5, inner + 500);
    place.apex_x_px = apex[0];
    place.apex_y_px = apex[1];
    place.radius_mm = inner;
    place.depth_mm = outer - inner;
    place.half_angle_rad = degrees * 3.14159265358979323846 / 180;
}

void read_linear(detail::JsonObject& json, ScanPlace& place) {
    const double left = json.number("left_px"), right = json.number("right_px"),
                 top = json.number("top_px"), bottom = json.number("bottom_px");
    if (!json.ok()) return;
    expect_between(json, "right_px", right, left + 16, left + 16384);
    expect_between(json, "bottom_px", bottom, top + 16, top + 16384);
    place.apex_x_px = 0.5 * (left + right - 1);
    place.apex_y_px = top - 0.5;
    place.width_mm = (right - left) * place.mm_per_px;
    place.depth_mm = (bottom - top) * place.mm_per_px;
}

}  // namespace

Result<GivenScan> parse_scan(const std::string& text, const std::string& where) {
    detail::JsonFault fault{where, {}};
    detail::Json value;
    if (!detail::parse_json(text, value, fault)) return *fault.error;
    detail::JsonObject json(value, "", fault);
    GivenScan scan;
    const std::string kind = json.text("kind");
    scan.place.mm_per_px = json.number("mm_per_px");
    if (json.ok()) {
        expect_between(json, "mm_per_px", scan.place.mm_per_px, 0.001, 10);
        if (kind == "fan") {
            read_fan(json, scan.place);
        } else if (kind == "linear") {
            read_linear(json, scan.place);
        } else {
            json.complain("kind", "is '" + kind + "'", "expected \"fan\" or \"linear\"");
        }
    }
    if (json.ok() && json.has("use")) {
        for (const double index : json.numbers("use", 0)) {
            if (index >= 0 && index < 1e9) scan.use.push_back(static_cast<std::size_t>(index));
        }
    }
    if (fault.error) return *fault.error;
    return scan;
}

}  // namespace sonocase::pipeline
