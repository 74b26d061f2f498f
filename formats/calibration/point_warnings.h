// SPDX-License-Identifier: Apache-2.0

// What the point calibration says about its answer. Internal to formats/calibration.
#pragma once

#include <span>

#include "formats/calibration/point.h"

namespace sonocase::calibrate {

// Whether the motion determines the tip: sets out.determined, or out.problem. Warns of a weak
// direction and of large residuals. sigma: of one coordinate of the residuals, mm; widest: the
// largest swing; poses: usable ones.
void judge_motion(double sigma, double widest, std::size_t poses, PointFit& out);

// Warnings about an answer that the motion determines: poses left out, too few poses, units and
// conventions of the export. Poses screened; all other fields of `out` are set.
void warn_of_doubtful_answer(std::span<const Pose> poses, double sigma, PointFit& out);

}  // namespace sonocase::calibrate
