// SPDX-License-Identifier: Apache-2.0

// Collects the kept frames of the cine loop, one per picture of the window, and writes them as a
// film. It asks for a frame by its place in the loop and takes it when the scan thread shows it.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "formats/base/result.h"
#include "runtime/player/session/scan_frame.h"

namespace sonocase::runtime::inline player_app {

class ClipSaver {
  public:
    // kept: frames in the loop; span_s: from the oldest to the newest. was_frozen: to be restored.
    ClipSaver(int kept, double span_s, bool was_frozen);

    int wanted_back() const { return back_; }
    // Once per picture with the frame shown. False: all are there.
    bool take(const ScanFrame& frame);
    double share() const;  // [0, 1], of the frames
    bool was_frozen() const { return was_frozen_; }
    // Ten per second at most, reduced to a side of 480, 64 greys and the
    // colours of the Doppler maps. Errors: it cannot be written.
    Status write(const std::string& path) const;

  private:
    int kept_, step_, back_;
    bool was_frozen_;
    int width_px_ = 0, height_px_ = 0;
    std::vector<double> times_s_;
    std::vector<std::vector<std::uint8_t>> frames_;  // values of the film's colours
};

}  // namespace sonocase::runtime::inline player_app
