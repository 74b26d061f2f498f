// SPDX-License-Identifier: Apache-2.0

#include "formats/recording/poses.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "formats/recording/pose_table.h"
#include "formats/text/number_text.h"

namespace sonocase {
namespace {

constexpr std::array<const char*, 15> kColumns{"frame", "timestamp_s", "status", "tx",  "ty",
                                               "tz",    "r00",         "r01",    "r02", "r10",
                                               "r11",   "r12",         "r20",    "r21", "r22"};
}  // namespace

Result<std::vector<Pose>> parse_poses(std::string_view csv, const std::string& where) {
    SONOCASE_TRY(std::vector<ToolReadings> tools, parse_pose_table(csv, where));
    if (tools.size() == 1) return std::move(tools.front().poses);
    std::string names;
    for (const ToolReadings& tool : tools) names += (names.empty() ? "" : ", ") + tool.name;
    return Error{"holds " + std::to_string(tools.size()) + " tools: " + names, where,
                 "expected the poses of one"};
}

bool has_times(std::span<const Pose> poses) {
    if (poses.size() < 2) return true;
    return std::any_of(poses.begin(), poses.end(), [&](const Pose& pose) {
        return pose.timestamp_s != poses.front().timestamp_s;
    });
}

Status check_times(std::span<const double> times_s, const std::string& where) {
    if (times_s.size() < 2) return Done{};
    std::vector<double> steps;
    std::size_t same = 0;
    for (std::size_t i = 1; i < times_s.size(); ++i) {
        const double step = times_s[i] - times_s[i - 1];
        if (step == 0) ++same;
        if (std::isfinite(step)) steps.push_back(step);
    }
    if (same + 1 == times_s.size())
        return Error{"its readings have no times, or all the same", where,
                     "time matters here: record with time stamps in seconds"};
    if (steps.size() < 10) return Done{};
    if (2 * same > steps.size())
        return Error{std::to_string(same) + " of " + std::to_string(times_s.size()) +
                         " times are that of the reading before",
                     where, "write time stamps with more digits, 0.001 s and finer"};
    const auto middle = steps.begin() + static_cast<std::ptrdiff_t>(steps.size() / 2);
    std::nth_element(steps.begin(), middle, steps.end());
    if (*middle > 3)
        return Error{"times rise by " + number_text(*middle, 4) + " s from reading to reading",
                     where, "expected seconds; these look like milliseconds"};
    return Done{};
}

Status check_places(std::span<const Pose> poses, const std::string& where) {
    double farthest = 0;
    int counted = 0;
    for (const Pose& pose : poses) {
        if (!pose.ok) continue;
        ++counted;
        farthest = std::max(farthest, norm(pose.tracker_from_tool.translation));
    }
    if (counted <= 10 || !(farthest < 10)) return Done{};
    return Error{"no pose lies farther than 10 mm from the origin", where,
                 "expected millimetres; these look like metres: multiply them by 1000"};
}

std::vector<Pose> poses_of(const Sequence& sequence, int transform) {
    std::vector<Pose> out;
    for (const SequenceFrame& frame : sequence.frames) {
        const SequencePose& given = frame.poses[static_cast<std::size_t>(transform)];
        if (given.absent) continue;
        Pose pose;
        pose.frame = frame.number;
        pose.timestamp_s = frame.timestamp_s;
        // A last row of other numbers is a transposed matrix: its place would be lost.
        const auto& m = given.to_from;
        pose.ok = given.ok && m[12] == 0 && m[13] == 0 && m[14] == 0 && m[15] == 1;
        for (std::size_t r = 0; r < 3; ++r) {
            for (std::size_t c = 0; c < 3; ++c)
                pose.tracker_from_tool.rotation.m[3 * r + c] = given.to_from[4 * r + c];
            pose.tracker_from_tool.translation[static_cast<int>(r)] = given.to_from[4 * r + 3];
        }
        out.push_back(pose);
    }
    return out;
}

Sequence sequence_of(const std::vector<std::pair<std::string, std::vector<Pose>>>& tools) {
    Sequence sequence;
    for (std::size_t tool = 0; tool < tools.size(); ++tool) {
        sequence.transforms.push_back(tools[tool].first);
        for (const Pose& pose : tools[tool].second) {
            SequenceFrame frame;
            frame.number = pose.frame;
            frame.timestamp_s = frame.unfiltered_timestamp_s = pose.timestamp_s;
            frame.poses.resize(tools.size(), {.absent = true});
            frame.poses[tool] = {pose.ok, matrix_from_rigid(pose.tracker_from_tool)};
            sequence.frames.push_back(std::move(frame));
        }
    }
    if (tools.size() > 1) join_frames(sequence);
    return sequence;
}

std::string format_poses(const std::vector<Pose>& poses) {
    std::string out;
    for (std::size_t c = 0; c < kColumns.size(); ++c)
        out += (c ? "," : "") + std::string(kColumns[c]);
    out += '\n';
    for (const Pose& pose : poses) {
        out += std::to_string(pose.frame) + ',';
        append_number(out, pose.timestamp_s);
        out += pose.ok ? ",OK" : ",INVALID";
        for (int a = 0; a < 3; ++a) {
            out += ',';
            append_number(out, pose.tracker_from_tool.translation[a]);
        }
        for (const double r : pose.tracker_from_tool.rotation.m) {
            out += ',';
            append_number(out, r);
        }
        out += '\n';
    }
    return out;
}

}  // namespace sonocase
