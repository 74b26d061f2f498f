// SPDX-License-Identifier: Apache-2.0

#include "formats/recording/poses.h"

#include <array>

#include "formats/text/number_text.h"

namespace sonocase {
namespace {

constexpr std::array<const char*, 15> kColumns{"frame", "timestamp_s", "status", "tx",  "ty",
                                               "tz",    "r00",         "r01",    "r02", "r10",
                                               "r11",   "r12",         "r20",    "r21", "r22"};

std::vector<std::string_view> split(std::string_view line) {
    std::vector<std::string_view> out;
    while (true) {
        const std::size_t comma = line.find(',');
        out.push_back(trimmed(line.substr(0, comma)));
        if (comma == std::string_view::npos) return out;
        line.remove_prefix(comma + 1);
    }
}

}  // namespace

Result<std::vector<Pose>> parse_poses(std::string_view csv, const std::string& where) {
    std::vector<Pose> poses;
    std::array<std::size_t, kColumns.size()> column{};
    bool have_header = false;
    int number = 0;
    if (csv.substr(0, 3) == "\xEF\xBB\xBF")
        csv.remove_prefix(3);  // a byte order mark, as spreadsheets write
    while (!csv.empty()) {
        const std::size_t end = csv.find('\n');
        const std::string_view line = trimmed(csv.substr(0, end));
        csv.remove_prefix(end == std::string_view::npos ? csv.size() : end + 1);
        ++number;
        if (line.empty() || line.front() == '#') continue;
        const std::vector<std::string_view> cells = split(line);
        const std::string at = where + ":" + std::to_string(number);
        if (!have_header) {
            for (std::size_t c = 0; c < kColumns.size(); ++c) {
                std::size_t i = 0;
                while (i < cells.size() && cells[i] != kColumns[c]) ++i;
                if (i == cells.size()) {
                    return Error{"column '" + std::string(kColumns[c]) + "' is missing", at,
                                 "the first line names the columns "
                                 "frame,timestamp_s,status,tx,ty,tz,r00,...,r22"};
                }
                column[c] = i;
            }
            have_header = true;
            continue;
        }
        std::array<double, kColumns.size()> values{};
        Pose pose;
        for (std::size_t c = 0; c < kColumns.size(); ++c) {
            if (column[c] >= cells.size()) {
                return Error{"holds " + std::to_string(cells.size()) + " cells", at,
                             "expected one per column"};
            }
            const std::string_view cell = cells[column[c]];
            if (c == 2) {
                pose.ok = cell == "OK";
                continue;
            }
            const bool read =
                c == 0 ? parse_number(cell, pose.frame) : parse_number(cell, values[c]);
            if (!read) {
                return Error{"'" + std::string(cell.substr(0, 40)) + "' is not a number", at,
                             "column '" + std::string(kColumns[c]) + "' must hold numbers"};
            }
        }
        pose.timestamp_s = values[1];
        pose.tracker_from_tool.translation = {values[3], values[4], values[5]};
        for (std::size_t i = 0; i < 9; ++i) pose.tracker_from_tool.rotation.m[i] = values[6 + i];
        poses.push_back(pose);
    }
    if (!have_header) return Error{"is empty", where, "expected poses as CSV"};
    return poses;
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
