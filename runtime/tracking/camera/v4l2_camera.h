// SPDX-License-Identifier: Apache-2.0

// Cameras of this machine through Video4Linux.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "runtime/tracking/camera/camera_tracker.h"

namespace sonocase::runtime::inline tracking_camera {

// The system's calls that a camera is used by; a test puts a camera of its own behind them. Each
// returns as its call does, with errno.
struct VideoCalls {
    virtual ~VideoCalls() = default;
    virtual int open(const char* path);
    virtual void close(int file);
    virtual int control(int file, unsigned long request, void* argument);  // ioctl
    virtual void* map(int file, std::size_t size, long offset);            // null: failed
    virtual void unmap(void* memory, std::size_t size);
    // Until there is a picture: above 0; 0: none for 0.1 s; below 0: the camera is gone.
    virtual int wait(int file);
};
VideoCalls& system_video();

// /dev/videoN as MJPEG or YUYV of 1280 x 720 where the camera has it, at its highest rate, with an
// exposure that does not slow it down. number -1: the first that gives pictures.
Result<std::unique_ptr<PictureSource>> open_v4l2_camera(int number,
                                                        VideoCalls& calls = system_video());

struct CameraDevice {
    int number = 0;    // of /dev/videoN
    std::string name;  // "HD Webcam"
};
// Those that give pictures, whether another program uses them or not. Cost: below a millisecond.
std::vector<CameraDevice> v4l2_cameras(VideoCalls& calls = system_video());

}  // namespace sonocase::runtime::inline tracking_camera
