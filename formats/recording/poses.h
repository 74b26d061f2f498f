// SPDX-License-Identifier: Apache-2.0

// Tracked poses: one row per reading, `frame,timestamp_s,status,tx,ty,tz,r00 ... r22`, mm,
// row-major. The pose maps points of the named tool to the tracker: p_tracker = R p_tool + t.
//
// Read as well: columns in any order and in either case, a quaternion (qw or q0, qx, qy, qz) for
// the nine numbers, NDI's Tx, Ty, Tz and State, a time in ms (time_ms), places in m or cm (tx_m),
// cells between semicolons or tabs, there with decimal commas. `frame`, a time and a status may be
// left out: rows are numbered, all times are 0 (has_times), every row counts.
#pragma once

#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "formats/base/geometry.h"
#include "formats/base/result.h"
#include "formats/recording/sequence.h"

namespace sonocase {

struct Pose {
    std::int64_t frame = 0;
    double timestamp_s = 0;
    bool ok = false;  // status was OK
    Rigid tracker_from_tool;
};

// Rows are kept as read, NaN and poor rotations included: the caller decides what to do with them.
Result<std::vector<Pose>> parse_poses(std::string_view csv, const std::string& where);
// False where a recording gives its readings no times: they all bear the same.
bool has_times(std::span<const Pose> poses);

// The readings of one transform of a sequence, those of other tools left out, kept as read.
std::vector<Pose> poses_of(const Sequence& sequence, int transform);
// The other way round: frames in the order of their times, those of equal times joined into one.
Sequence sequence_of(const std::vector<std::pair<std::string, std::vector<Pose>>>& tools);
std::string format_poses(const std::vector<Pose>& poses);

}  // namespace sonocase
