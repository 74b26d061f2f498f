// SPDX-License-Identifier: Apache-2.0

// Refines the point calibration with an estimate that allows for noise in orientation as well as in
// position.
//
// The linear fit takes the rotations as exact. If the tilt is small their noise biases it: the
// swing is overestimated and the tip is drawn towards the position with the smallest residuals.
// Here each pose may turn by a small rotation w_i, penalised by its expected size:
//
//     min sum |R_i exp(w_i) t + p_i - c|^2 / sigma_p^2 + |w_i|^2 / sigma_r^2
//
// with a Cauchy loss on the first term, by Ceres with a Schur complement on the w_i.
#pragma once

#include <span>

#include "formats/calibration/point.h"

namespace sonocase::pipeline::inline calibration {

struct RefinePointOptions {
    double position_sigma_mm = 0.5;      // of one coordinate of a reading, > 0
    double rotation_sigma_rad = 0.0026;  // 0.15 degrees, > 0
    int max_iterations = 50;
};

struct RefinePointResult {
    Vector3 tip_mm;
    Point3 pivot_mm;
    Vector3 sigma_mm;
    double rms_mm = 0;
    double moved_mm = 0;  // from the start
    int iterations = 0;
    bool converged = false;
    double seconds = 0;
};

// `start` is a determined fit of the same readings with one resting point. Poor convergence is
// reported (converged == false), not an error.
RefinePointResult refine_point(std::span<const Pose> poses,
                               const PointFit& start,
                               const RefinePointOptions& options = {});

}  // namespace sonocase::pipeline::inline calibration
