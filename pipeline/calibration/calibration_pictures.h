// SPDX-License-Identifier: Apache-2.0

// Pictures of a calibration, which show what no single number does: residuals over the recording,
// their histogram, how far the tool was tilted in each direction, and the image with its mark. PNG
// and SVG.
#pragma once

#include <string>

#include "formats/calibration/direction.h"
#include "formats/calibration/image_plane.h"
#include "formats/calibration/lag.h"
#include "formats/calibration/landmarks.h"
#include "formats/calibration/needle.h"
#include "formats/calibration/point.h"

namespace sonocase::pipeline::inline calibration {

// Each writes FOLDER/NAME.png and .svg; the folder is made if it does not exist.
Status draw_point_pictures(std::span<const Pose> poses,
                           const PointFit& fit,
                           const std::string& folder,
                           const std::string& name);
Status draw_direction_pictures(std::span<const Pose> poses,
                               const DirectionFit& fit,
                               const std::string& folder,
                               const std::string& name);
Status draw_needle_pictures(const NeedleFit& fit,
                            const std::string& folder,
                            const std::string& name);
Status draw_rigid_pictures(std::span<const Point3> from,
                           std::span<const Point3> to,
                           const RigidFit& fit,
                           const std::string& folder,
                           const std::string& name);
Status draw_lag_pictures(const Signal& first,
                         const Signal& second,
                         const LagFit& fit,
                         const std::string& folder,
                         const std::string& name);
// The image's outline in the probe's plane as it will appear on the screen, with the orientation
// mark, the letter F (which shows a mirrored image at a glance) and the touches.
Status draw_image_picture(const ImagePlaneInput& input,
                          const ImagePlane& plane,
                          const std::string& folder,
                          const std::string& name);

}  // namespace sonocase::pipeline::inline calibration
