// SPDX-License-Identifier: Apache-2.0

// How a camera maps space to pixels: focal lengths, middle, and the distortion of Brown (1966) with
// three radial and two tangential terms, in the form and order that OpenCV has; and the file (JSON)
// that keeps it, together with the markers that it follows: their sizes and how they were built.
//
// Camera frame: x right, y down, z forward, mm. Pixels: the middle of the first one is (0, 0), x
// right, y down.
#pragma once

#include <array>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "formats/base/geometry.h"
#include "formats/base/result.h"
#include "formats/markers/marker_set.h"

namespace sonocase {

struct Pixel {
    double x = 0, y = 0;
};

struct CameraModel {
    int width_px = 1280, height_px = 720;
    double fx_px = 0, fy_px = 0, cx_px = 0, cy_px = 0;
    double k1 = 0, k2 = 0, p1 = 0, p2 = 0, k3 = 0;
    // Of the calibration; negative: none, the camera is assumed to see 65 degrees across its width.
    double rms_px = -1;
    double sigma_focal_px = -1;  // one standard deviation of fx_px
    int pictures = 0;
    std::string camera, date;  // as the user and the clock have it

    bool calibrated() const { return rms_px >= 0; }
    bool operator==(const CameraModel&) const = default;
};

// A camera of which nothing is known: square pixels, no distortion.
inline constexpr double kAssumedViewDeg = 65;
CameraModel assumed_camera(int width_px, int height_px, double view_deg = kAssumedViewDeg);
// The same camera at another picture size of the same shape. Error: another shape, which crops the
// sensor in a way that is not known.
Result<CameraModel> at_size(const CameraModel& camera, int width_px, int height_px);

// Where a point appears; false, with nothing written, for points that are not in front. jacobian:
// 2 x 3, row by row, of the pixel by the point; may be null. Constant time, no allocation.
bool project(const CameraModel& camera, Vector3 point_camera, Pixel& pixel, double* jacobian);
// The direction (x, y, 1) that appears at a pixel, by Newton's iteration.
Vector3 direction_at(const CameraModel& camera, Pixel pixel);

struct CameraSetup {
    CameraModel camera;
    MarkerSizes markers;
    std::vector<BuiltTag> built;  // tags that were measured where they are; the others as drawn
    bool operator==(const CameraSetup&) const = default;
};
std::vector<MarkerBody> marker_bodies(const CameraSetup& setup);

Result<CameraSetup> parse_camera(std::string_view json, const std::string& where);
std::string format_camera(const CameraSetup& setup);

}  // namespace sonocase
