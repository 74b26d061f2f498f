// SPDX-License-Identifier: Apache-2.0

#include "formats/markers/camera_model.h"

#include <algorithm>
#include <cmath>

#include "formats/base/constants.h"
#include "formats/text/json_reader.h"

namespace sonocase {
namespace {

using detail::Json;
using detail::JsonFault;
using detail::JsonObject;

constexpr const char* kFormat = "sonocase camera";
constexpr int kVersion = 1;

// The distorted place of an undistorted (x, y) at z = 1, and its derivatives.
struct Distorted {
    double x, y, xx, xy, yx, yy;  // xy: of x by y
};

Distorted distort(const CameraModel& c, double x, double y) {
    const double r2 = x * x + y * y;
    const double radial = 1 + r2 * (c.k1 + r2 * (c.k2 + r2 * c.k3));
    const double slope = 2 * (c.k1 + r2 * (2 * c.k2 + r2 * 3 * c.k3));  // d radial / d r2, twice
    return {x * radial + 2 * c.p1 * x * y + c.p2 * (r2 + 2 * x * x),
            y * radial + c.p1 * (r2 + 2 * y * y) + 2 * c.p2 * x * y,
            radial + x * x * slope + 2 * c.p1 * y + 6 * c.p2 * x,
            x * y * slope + 2 * c.p1 * x + 2 * c.p2 * y,
            x * y * slope + 2 * c.p1 * x + 2 * c.p2 * y,
            radial + y * y * slope + 6 * c.p1 * y + 2 * c.p2 * x};
}

}  // namespace

CameraModel assumed_camera(int width_px, int height_px, double view_deg) {
    CameraModel c;
    c.width_px = width_px;
    c.height_px = height_px;
    c.fx_px = c.fy_px = 0.5 * width_px / std::tan(0.5 * view_deg * kPi / 180);
    c.cx_px = 0.5 * (width_px - 1);
    c.cy_px = 0.5 * (height_px - 1);
    return c;
}

Result<CameraModel> at_size(const CameraModel& camera, int width_px, int height_px) {
    CameraModel c = camera;
    if (width_px == c.width_px && height_px == c.height_px) return c;
    const double scale = static_cast<double>(width_px) / c.width_px;
    if (std::abs(height_px - scale * c.height_px) > 1) {
        return Error{Message("pictures of {} x {}, but the camera was calibrated at {} x {}",
                             {std::to_string(width_px), std::to_string(height_px),
                              std::to_string(c.width_px), std::to_string(c.height_px)}),
                     "camera", "calibrate it at this size"};
    }
    c.width_px = width_px;
    c.height_px = height_px;
    c.fx_px *= scale;
    c.fy_px *= scale;
    c.cx_px = (c.cx_px + 0.5) * scale - 0.5;
    c.cy_px = (c.cy_px + 0.5) * scale - 0.5;
    c.sigma_focal_px *= c.sigma_focal_px > 0 ? scale : 1;
    return c;
}

bool project(const CameraModel& c, Vector3 p, Pixel& pixel, double* jacobian) {
    constexpr double kNearest = 1;  // mm
    if (!(p.z > kNearest)) return false;
    const double iz = 1 / p.z, x = p.x * iz, y = p.y * iz;
    const Distorted d = distort(c, x, y);
    pixel = {c.fx_px * d.x + c.cx_px, c.fy_px * d.y + c.cy_px};
    if (jacobian) {
        jacobian[0] = c.fx_px * d.xx * iz;
        jacobian[1] = c.fx_px * d.xy * iz;
        jacobian[2] = -c.fx_px * (d.xx * x + d.xy * y) * iz;
        jacobian[3] = c.fy_px * d.yx * iz;
        jacobian[4] = c.fy_px * d.yy * iz;
        jacobian[5] = -c.fy_px * (d.yx * x + d.yy * y) * iz;
    }
    return true;
}

Vector3 direction_at(const CameraModel& c, Pixel pixel) {
    const double u = (pixel.x - c.cx_px) / c.fx_px, v = (pixel.y - c.cy_px) / c.fy_px;
    double x = u, y = v;
    for (int i = 0; i < 12; ++i) {
        const Distorted d = distort(c, x, y);
        const double det = d.xx * d.yy - d.xy * d.yx;
        if (!(det > 1e-6)) break;  // beyond the bend of the polynomial there is no inverse
        const double ex = d.x - u, ey = d.y - v;
        x -= (d.yy * ex - d.xy * ey) / det;
        y -= (d.xx * ey - d.yx * ex) / det;
        if (std::abs(ex) + std::abs(ey) < 1e-12) break;
    }
    return {x, y, 1};
}

std::vector<MarkerBody> marker_bodies(const CameraSetup& setup) {
    std::vector<MarkerBody> bodies = marker_bodies(setup.markers);
    place_tags_as_built(bodies, setup.built);
    return bodies;
}

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
    for (const BuiltTag& tag : setup.built)
        out["built"].push_back({{"id", tag.id},
                                {"moved_mm", detail::json_of(tag.moved_mm)},
                                {"turned_rad", detail::json_of(tag.turned_rad)}});
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
    if (object.has("built")) {
        for (JsonObject& entry : object.objects("built")) {
            BuiltTag tag;
            tag.id = static_cast<int>(entry.integer("id", 0, kMarkerTagIds - 1));
            tag.moved_mm = entry.vector("moved_mm");
            tag.turned_rad = entry.vector("turned_rad");
            if (norm(tag.moved_mm) > kMaxTagMoved_mm)
                entry.add_fault("moved_mm", "is farther than a tag can be glued from its place");
            if (norm(tag.turned_rad) > kMaxTagTurned_rad)
                entry.add_fault("turned_rad", "is more than a tag can be glued askew");
            for (const BuiltTag& other : setup.built)
                if (other.id == tag.id) entry.add_fault("id", "is there twice");
            setup.built.push_back(tag);
        }
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
