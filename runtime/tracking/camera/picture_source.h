// SPDX-License-Identifier: Apache-2.0

// What a camera is to the tracker: one grey picture after another, with the time of its exposure.
#pragma once

#include <functional>
#include <memory>
#include <string>

#include "formats/base/result.h"
#include "formats/markers/detect/grey_jpeg.h"

namespace sonocase::runtime::inline tracking_camera {

class PictureSource {
  public:
    virtual ~PictureSource() = default;
    virtual std::string name() const = 0;  // "HD Webcam"
    virtual int width_px() const = 0;
    virtual int height_px() const = 0;
    // Waits up to 0.1 s for the newest picture; older ones that were not asked for are dropped.
    // True: one came. age_s: since the middle of its exposure. Errors end the source: unplugged,
    // pictures that cannot be read.
    virtual Result<bool> next(GreyImage& picture, double& age_s) = 0;
};

// Opens a camera. An error with an empty `where` means that there is none yet; others, such as a
// camera that another program uses, are shown. Either way it is tried again.
using OpenSource = std::function<Result<std::unique_ptr<PictureSource>>()>;

// /dev/videoN by V4L2, as MJPEG or YUYV of 1280 x 720 where the camera has it, at its highest rate,
// with an exposure that does not slow it down. number -1: the first that gives pictures.
Result<std::unique_ptr<PictureSource>> open_v4l2_camera(int number);

}  // namespace sonocase::runtime::inline tracking_camera
