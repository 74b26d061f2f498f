// SPDX-License-Identifier: Apache-2.0

// Tracked poses of one tool, and their way to sequences and back. On disk they are a table
// (formats/recording/pose_table.h): `frame,timestamp_s,status,tx,ty,tz,r00 ... r22`, mm, row-major.
// The pose maps points of the named tool to the tracker: p_tracker = R p_tool + t.
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

// Of a table that holds one tool. Rows are kept as read, NaN and poor rotations included: the
// caller decides what to do with them.
Result<std::vector<Pose>> parse_poses(std::string_view csv, const std::string& where);
// False where a recording gives its readings no times: they all bear the same.
bool has_times(std::span<const Pose> poses);

// An Error for times that nothing can be told from where time matters: all the same, or most of
// them that of the reading before; and for times that rise by more than 3 s from reading to
// reading, which are milliseconds. times_s: of one tool, in the order of its readings.
Status check_times(std::span<const double> times_s, const std::string& where);

// An Error for places in metres: more than ten poses that count, none farther than 10 mm from the
// origin. No tracker measures a tool for long so near to its own origin, and none 10 m away.
Status check_places(std::span<const Pose> poses, const std::string& where);

// The readings of one transform of a sequence, those of other tools left out, kept as read.
std::vector<Pose> poses_of(const Sequence& sequence, int transform);
// The other way round: frames in the order of their times, those of equal times joined into one.
Sequence sequence_of(const std::vector<std::pair<std::string, std::vector<Pose>>>& tools);
std::string format_poses(const std::vector<Pose>& poses);

}  // namespace sonocase
