// SPDX-License-Identifier: Apache-2.0

#include "formats/markers/camera_setup.h"

#include <algorithm>
#include <cmath>

#include "formats/text/json_reader.h"

namespace sonocase {
namespace {

using detail::Json;
using detail::JsonFault;
using detail::JsonObject;

constexpr const char* kFormat = "sonocase camera";
constexpr int kVersion = 1;

}  // namespace

std::string format_camera(const CameraSetup& setup) {
    const CameraModel& c = setup.camera;
    const MarkerSizes& m = setup.markers;
    Json out = Json::object();
    out["format"] = kFormat;
    out["version"] = kVersion;
    out["camera"] = c.camera;
    out["width_px"] = c.width_px;
    out["height_px"] = c.height_px;
    out["focal_px"] = {c.fx_px, c.fy_px};
    out["middle_px"] = {c.cx_px, c.cy_px};
    out["distortion"] = {c.k1, c.k2, c.p1, c.p2, c.k3};
    out["rms_px"] = detail::json_number(c.rms_px);
    out["sigma_focal_px"] = detail::json_number(c.sigma_focal_px);
    out["pictures"] = c.pictures;
    out["date"] = c.date;
    out["markers"] = {{"body_mm", m.body_mm},
                      {"probe_reach_mm", m.probe_reach_mm},
                      {"needle_reach_mm", m.needle_reach_mm},
                      {"board_tag_mm", m.board_tag_mm},
                      {"ruler_mm", m.ruler_mm}};
    return detail::json_text(out, true) + "\n";
}

Result<CameraSetup> parse_camera(std::string_view json, const std::string& where) {
    Json value;
    JsonFault fault{where, {}};
    if (!detail::parse_json(json, value, fault)) return *fault.error;
    JsonObject object(value, "", fault);
    detail::expect_format(object, kFormat, kVersion, "calibrate camera");
    CameraSetup setup;
    CameraModel& c = setup.camera;
    c.camera = object.text_or("camera", "");
    c.date = object.text_or("date", "");
    c.width_px = static_cast<int>(object.integer("width_px", 160, 16384));
    c.height_px = static_cast<int>(object.integer("height_px", 120, 16384));
    const std::vector<double> focal = object.numbers("focal_px", 2);
    const std::vector<double> middle = object.numbers("middle_px", 2);
    const std::vector<double> distortion = object.numbers("distortion", 5);
    c.rms_px = object.number_or("rms_px", -1);
    c.sigma_focal_px = object.number_or("sigma_focal_px", -1);
    c.pictures = static_cast<int>(object.integer_or("pictures", 0, 0, 1000000));
    if (object.has("markers")) {
        JsonObject markers = object.object("markers");
        MarkerSizes& m = setup.markers;
        m.body_mm = markers.number_or("body_mm", m.body_mm);
        m.probe_reach_mm = markers.number_or("probe_reach_mm", m.probe_reach_mm);
        m.needle_reach_mm = markers.number_or("needle_reach_mm", m.needle_reach_mm);
        m.board_tag_mm = markers.number_or("board_tag_mm", m.board_tag_mm);
        m.ruler_mm = markers.number_or("ruler_mm", m.ruler_mm);
    }
    if (fault.error) return *fault.error;
    SONOCASE_TRY_DONE(check_marker_sizes(setup.markers));
    c.fx_px = focal[0], c.fy_px = focal[1];
    c.cx_px = middle[0], c.cy_px = middle[1];
    c.k1 = distortion[0], c.k2 = distortion[1], c.p1 = distortion[2], c.p2 = distortion[3];
    c.k3 = distortion[4];
    const double low = 0.1 * c.width_px, high = 10.0 * c.width_px;
    if (std::min(c.fx_px, c.fy_px) < low || std::max(c.fx_px, c.fy_px) > high)
        object.add_fault("focal_px", "does not fit the picture's width");
    if (c.cx_px < 0 || c.cx_px > c.width_px || c.cy_px < 0 || c.cy_px > c.height_px)
        object.add_fault("middle_px", "lies outside the picture");
    for (const double k : distortion)
        if (std::abs(k) > 10) object.add_fault("distortion", "is beyond that of any lens");
    if (fault.error) return *fault.error;
    return setup;
}

}  // namespace sonocase
