// SPDX-License-Identifier: Apache-2.0

// A camera's focal lengths, middle and distortion from pictures of the board held at various tilts:
// least squares over all pictures at once, each tag with its covariance, by Ceres (Zhang, "A
// flexible new technique for camera calibration", PAMI 2000; distortion as in
// formats/markers/camera_model.h).
#pragma once

#include <string>
#include <vector>

#include "formats/markers/body_pose.h"

namespace sonocase::pipeline::inline calibration {

struct MarkerView {
    int picture = 0;  // of the video
    std::vector<SeenTag> tags;
};

struct CameraFitOptions {
    int min_views = 8;
    double min_tilt_deg = 12;   // spread of the board's tilts: head-on alone, distance and focal
                                // length cannot be told apart
    double min_coverage = 0.6;  // of the picture's fields that tags were seen in
    double max_focal_error = 0.003;  // one standard deviation, of the focal length
};

inline constexpr int kFieldColumns = 6, kFieldRows = 4;

struct CameraFit {
    CameraModel camera;
    // Empty: the answer may be used. Otherwise why not, and what to do.
    std::string problem;
    double tilt_deg = 0, coverage = 0;
    int fields[kFieldRows][kFieldColumns] = {};  // corners seen in each part of the picture
    int views = 0, corners = 0;
    double worst_view_px = 0;               // root mean square
    double sigma_px[4] = {-1, -1, -1, -1};  // of fx, fy, cx, cy
    std::vector<std::string> warnings;
};

// views: pictures of one size, each with three tags of the board at least, as fit_tag() has them.
// Deterministic.
// Cost: about two seconds for 40 views.
CameraFit fit_camera(const std::vector<MarkerView>& views,
                     const MarkerBody& board,
                     int width_px,
                     int height_px,
                     const CameraFitOptions& options = {});

}  // namespace sonocase::pipeline::inline calibration
