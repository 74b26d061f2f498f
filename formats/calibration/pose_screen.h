// SPDX-License-Identifier: Apache-2.0

// Which rows of a recording can be used, and why the others cannot: the first step of every
// calibration.
#pragma once

#include <span>
#include <string>
#include <vector>

#include "formats/recording/poses.h"

namespace sonocase {

struct PoseScreen {
    std::vector<Pose> poses;            // usable, in order; rotations exactly orthonormal
    std::vector<std::string> warnings;  // one sentence per kind of trouble, each with what to do
    int rows = 0;                       // as given
    int not_ok = 0;                     // status was not OK
    int not_finite = 0;                 // NaN or infinite
    int not_rotation = 0;               // columns not orthonormal to 0.05: left out
    int mirrored = 0;                   // determinant -1: left out
    int straightened = 0;               // orthonormal to 0.001..0.05: used, made orthonormal
    // Positions 10, 25.4, 100 or 1000 times the others', or the inverse: left out.
    int other_units = 0;
    int flipped = 0;   // orientation is the inverse of its neighbours': left out
    int repeated = 0;  // identical to the row before: used
};

// Leaves out the rows that cannot be a pose in mm and reports them; never fails. Linear time.
PoseScreen screen_poses(std::span<const Pose> poses);

// The tool relative to a reference that may move: reference_from_tool for each reading of `tool`
// that has a reading of `reference` within half a frame. Not OK if either reading is not. Rows
// without a counterpart are left out.
std::vector<Pose> relative_poses(std::span<const Pose> reference, std::span<const Pose> tool);

// Hex digest of the readings, for a saved calibration's data_digest.
std::string digest_of_poses(std::span<const Pose> poses);

}  // namespace sonocase
