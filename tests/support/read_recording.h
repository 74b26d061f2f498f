// SPDX-License-Identifier: Apache-2.0

// Recordings of ../shared/data/tracking for tests; empty where the data is absent:
//
//     const std::vector<Pose> poses = read_recording("pivot_optical_yaniv/poses.csv");
//     if (poses.empty()) GTEST_SKIP() << kNoRecordings;
#pragma once

#include <fstream>
#include <sstream>
#include <string>
#include <vector>

#include "formats/recording/poses.h"
#include "support/paths.h"

namespace sonocase::testing {

inline constexpr const char* kNoRecordings = "no " SONOCASE_DATA "/tracking";

inline std::vector<Pose> read_recording(const std::string& name) {
    std::vector<Pose> poses;
    std::ifstream in(std::string(SONOCASE_DATA) + "/tracking/" + name);
    if (!in) return poses;
    std::string line;
    std::getline(in, line);
    while (std::getline(in, line)) {
        std::stringstream cells(line);
        std::string cell;
        std::vector<std::string> row;
        while (std::getline(cells, cell, ',')) row.push_back(cell);
        if (row.size() != 15) continue;
        Pose pose;
        pose.frame = std::stoll(row[0]);
        pose.timestamp_s = std::stod(row[1]);
        pose.ok = row[2] == "OK";
        for (int c = 0; c < 3; ++c) {
            pose.tracker_from_tool.translation[c] = std::stod(row[static_cast<std::size_t>(3 + c)]);
        }
        for (std::size_t k = 0; k < 9; ++k)
            pose.tracker_from_tool.rotation.m[k] = std::stod(row[6 + k]);
        poses.push_back(pose);
    }
    return poses;
}

}  // namespace sonocase::testing
