// SPDX-License-Identifier: Apache-2.0

// Tables of tracked poses, one row per reading, of one tool or of several.
//
// Ours: `frame,timestamp_s,status,tx,ty,tz,r00 ... r22`, mm, row-major. Read as well: columns in
// any order and in either case; a quaternion (qw or q0, qx, qy, qz) for the nine numbers; a time in
// ms, us or ns (time_ms); places in m or cm (tx_m); cells between semicolons, tabs or blanks, there
// with decimal commas; a first line after '#' or after "sep=". `frame`, a time and a status may be
// left out: rows are numbered, all times are 0, every row counts. Cells without a number ("", NaN,
// 1.#QNAN, NDI's -3.697314e28) for a whole pose are a tool that was lost. A row of units below the
// names ("s,mm,mm,mm") is taken.
//
// Several tools: a column `tool` (or name, device, port, handle, sensor, rigid_body) that says
// whose reading a row is; columns with the tool's name before them (probe_tx, needle_qw); the same
// columns again for each tool, as NDI's programs write them; and OptiTrack Motive's export.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "formats/base/result.h"
#include "formats/recording/poses.h"

namespace sonocase {

struct ToolReadings {
    std::string name;  // as the table has it; empty: the table has one tool and no name for it
    std::vector<Pose> poses;
};

// True for a cell that holds no number: "", "NaN", "-1.#IND", "missing".
bool is_none(std::string_view cell);

// At least one tool, those of one name joined. Rows are kept as read, NaN and poor rotations
// included. Errors name the line: a row with too few or too many cells, what is no number, a
// quaternion of another length than 1, places in inches, a status that no row's is known; times
// that step like milliseconds in a column that does not name its unit.
Result<std::vector<ToolReadings>> parse_pose_table(std::string_view text, const std::string& where);

}  // namespace sonocase
