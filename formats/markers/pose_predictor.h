// SPDX-License-Identifier: Apache-2.0

// Where a tool is now, from a camera's poses of some hundredths of a second ago.
//
// A Kalman filter of constant velocity, of the tool's own point (3) and of its turn (3), each with
// its velocity. It is taken rather than a One-Euro filter because a prediction needs a velocity,
// which One-Euro has only as an aside, and because every pose brings its own covariance, of which a
// camera's is ten times longer along its axis than across it. From One-Euro comes the idea that
// stills the hand and follows the stroke: the acceleration that is expected grows with the speed.
// What a hand does after the last picture nothing tells: one that sets off or stops at a mm/s2 is
// shown off by up to a t^2 / 2, 1 mm for 1000 mm/s2 and t = 45 ms.
#pragma once

#include <memory>

#include "formats/markers/marker_follower.h"

namespace sonocase {

struct PredictorOptions {
    // Standard deviation of the acceleration of a tool that rests, and what its speed adds to it.
    double rest_mm_s2 = 60, rest_rad_s2 = 0.4;
    double by_speed_per_s = 2;
    // No prediction goes farther: what a hand does in a tenth of a second is not known.
    double max_mm = 8, max_rad = 0.07;
    double max_gap_s = 0.15;  // without a pose it starts anew
};

class PosePredictor {
  public:
    // tool_body: the point whose place counts.
    explicit PosePredictor(Point3 tool_body, const PredictorOptions& options = {});
    PosePredictor(PosePredictor&&) noexcept;
    PosePredictor& operator=(PosePredictor&&) noexcept;
    ~PosePredictor();

    // The body's pose at at_s from readings of time_s, which rise. A reading that is lost, or of
    // which two poses fit alike, comes back as it is, and the filter starts anew after it. Cost: 2
    // us; allocates nothing.
    Rigid follow(const MarkerReading& reading, double time_s, double at_s);

  private:
    struct State;
    std::unique_ptr<State> state_;
};

}  // namespace sonocase
