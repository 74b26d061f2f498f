// SPDX-License-Identifier: Apache-2.0

// Where the image lies in the probe: middle and width of the face, scale, and which way is left.
//
// image    u to the right, v down, pixels; (0, 0) is the centre of the first pixel
// probe    x lateral towards the orientation mark, y elevation, z depth;
//          origin at the middle of the face
//
//     x = lateral_sign (u - u0) mm_per_px,   z = (v - v0) mm_per_px
//
// The mark is drawn on the left of the image unless mark_on_left is false, so that lateral_sign is
// -1. Two touches of a calibrated pointer, on the marked end of the face and on the other,
// determine the rest. They also show whether the image is mirrored, the commonest fault of such a
// set-up and the hardest to notice.
#pragma once

#include <span>
#include <string>
#include <vector>

#include "formats/base/geometry.h"

namespace sonocase {

struct ImagePlaneInput {
    Rigid sensor_from_probe;        // from the point and direction calibrations
    std::vector<Point3> mark_end;   // touches of the marked end of the face, sensor frame
    std::vector<Point3> other_end;  // touches of the other end
    // Touches of anything in front of the face, sensor frame; may be empty.
    std::vector<Point3> in_front;
    double depth_mm = 150;    // of the image, top to bottom, > 0
    double footprint_mm = 0;  // of the face, if known; 0: from the touches
    int width_px = 512, height_px = 512;
    bool mark_on_left = true;
};

struct ImagePlane {
    Rigid sensor_from_probe;  // recentred on the middle of the face
    double footprint_mm = 0;
    double mm_per_px = 0;
    double u0 = 0, v0 = 0;  // pixel of the middle of the face
    int lateral_sign = -1;
    bool mirrored = false;      // the touches lie on the other side than the frame says
    bool upside_down = false;   // the touches in front of the face have negative depth
    double face_angle_rad = 0;  // between the touched face and the lateral axis
    double off_plane_mm = 0;    // of the touches, rms
    double rms_mm = 0;          // scatter of repeated touches
    bool determined = false;
    std::string problem;
    std::vector<std::string> warnings;

    Point3 probe_from_pixel(double u, double v) const;
};

// Never fails. If the image is mirrored, the frame is turned by half a turn about the depth axis
// and a warning says so.
ImagePlane fit_image_plane(const ImagePlaneInput& input);

}  // namespace sonocase
