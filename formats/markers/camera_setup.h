// SPDX-License-Identifier: Apache-2.0

// The file of a camera (JSON): how it maps space to pixels, and which markers are printed for it.
#pragma once

#include <string>
#include <string_view>

#include "formats/markers/camera_model.h"
#include "formats/markers/marker_set.h"

namespace sonocase {

struct CameraSetup {
    CameraModel camera;
    MarkerSizes markers;
    bool operator==(const CameraSetup&) const = default;
};

Result<CameraSetup> parse_camera(std::string_view json, const std::string& where);
std::string format_camera(const CameraSetup& setup);

}  // namespace sonocase
