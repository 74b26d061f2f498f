// SPDX-License-Identifier: Apache-2.0

// Tracked poses: one row per reading, `frame,timestamp_s,status,tx,ty,tz,r00 ... r22`, mm,
// row-major. The pose maps points of the named tool to the tracker: p_tracker = R p_tool + t.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "formats/base/geometry.h"
#include "formats/base/result.h"

namespace sonocase {

struct Pose {
    std::int64_t frame = 0;
    double timestamp_s = 0;
    bool ok = false;  // status was OK
    Rigid tracker_from_tool;
};

// Rows are kept as read, NaN and poor rotations included: the caller decides what to do with them.
Result<std::vector<Pose>> parse_poses(std::string_view csv, const std::string& where);
std::string format_poses(const std::vector<Pose>& poses);

}  // namespace sonocase
