// SPDX-License-Identifier: Apache-2.0

// Pictures of printed marker bodies as a cheap camera takes them, by casting rays: perspective,
// lens distortion, shading, a textured ground, defocus, motion blur, a rolling shutter, light that
// flickers with the mains, and noise. The truth is what was put in.
#pragma once

#include <cstdint>
#include <functional>
#include <vector>

#include "formats/base/random.h"
#include "formats/markers/camera_model.h"
#include "formats/markers/marker_set.h"

namespace sonocase::testing {

struct VideoOptions {
    double noise_grey = 3;    // standard deviation
    double defocus_px = 0.8;  // standard deviation of the blur
    double exposure_s = 0.008;
    double readout_s = 0.015;  // from the first row to the last; 0: all rows at once
    double flicker = 0.05;     // half the change of brightness from the mains, at 100 Hz
    double brightness = 1;
    bool ground = true;
    bool mirrored = false;
};

struct PlacedBody {
    const MarkerBody* body = nullptr;
    // camera_from_body at a time.
    std::function<Rigid(double)> pose;
};

inline PlacedBody still_body(const MarkerBody& body, const Rigid& camera_from_body) {
    return {&body, [camera_from_body](double) { return camera_from_body; }};
}

class MarkerVideo {
  public:
    explicit MarkerVideo(const CameraModel& camera, std::uint64_t seed = 1);

    // What lies still from now on is drawn once and for all, as is its defocus.
    void keep(const PlacedBody& still, const VideoOptions& options = {}) {
        paint(still, 0, options, ground_);
    }
    // The picture whose exposure is centred on time_s in its middle row.
    std::vector<std::uint8_t> take(const std::vector<PlacedBody>& bodies,
                                   double time_s,
                                   const VideoOptions& options = {});

  private:
    void paint(const PlacedBody& placed,
               double time_s,
               const VideoOptions& options,
               std::vector<float>& picture);

    CameraModel camera_;
    RandomStream random_;
    std::vector<Vector3> rays_;  // at the corners of pixels
    std::vector<float> ground_, noise_;
};

}  // namespace sonocase::testing
