// SPDX-License-Identifier: Apache-2.0

// Which poses of a recording the point calibration uses, and in how many groups. Internal to
// formats/calibration.
#pragma once

#include <span>
#include <vector>

#include "formats/calibration/point.h"
#include "formats/calibration/solve/pivot_system.h"

namespace sonocase::calibrate {

PoseGroup all_poses(std::size_t count);

// The poses that rest on one point, outliers left out; or, where the options allow several resting
// points and these explain the recording far better, one group per resting point. At least one
// group, none of them empty. Poses screened, positions centred.
std::vector<PoseGroup> resting_poses(std::span<const Pose> poses, const PointOptions& options);

// Standard deviation of one coordinate of the residuals, allowing for the fitted unknowns.
double residual_sigma_mm(const PivotSolution& s, std::size_t groups);

}  // namespace sonocase::calibrate
