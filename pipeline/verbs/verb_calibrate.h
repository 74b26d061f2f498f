// SPDX-License-Identifier: Apache-2.0

// What the kinds of `sonocase calibrate` share: they read recordings, and write JSON and
// calibration files.
#pragma once

#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include "formats/calibration/calibration.h"
#include "formats/calibration/point.h"
#include "formats/recording/poses.h"
#include "pipeline/verbs/verb_common.h"

namespace sonocase::pipeline::inline verbs {

using Json = nlohmann::ordered_json;

struct CalibrateOptions {
    CommonOptions common;
    std::vector<std::string> poses, reference;
    std::string transform, output, pictures, sensor, date;
    bool json = false;

    void add(CLI::App& app, int min_recordings);  // that --poses must name
    Result<std::vector<Pose>> load(const std::string& path) const;
    Result<std::vector<Pose>> recording(std::size_t k) const;  // relative to --reference
    Result<std::vector<Pose>> all_recordings() const;          // one after the other
    std::string today() const;                                 // --date, or now
};

// A number that is not finite is written as null.
Json json_number(double v);
Json json_triple(Vector3 v);
Json json_triple(Point3 v);
Json json_matrix(const Matrix3& m);
Json json_residuals(const std::vector<PoseResidual>& residuals);

std::string text_line(const char* format, ...) __attribute__((format(printf, 1, 2)));

// Prints and saves the result of a kind; returns the exit status. An empty `problem` means that
// there is an answer; `people` is the text that is printed without --json.
int finish_calibration(const CalibrateOptions& options,
                       const Json& result,
                       const std::string& people,
                       Calibration calibration,
                       const std::string& problem,
                       const std::vector<std::string>& warnings,
                       double seconds);

int calibrate_point(int argc, char** argv);
int calibrate_direction(int argc, char** argv);
int calibrate_needle(int argc, char** argv);
int calibrate_mannequin(int argc, char** argv);
int calibrate_image(int argc, char** argv);
int calibrate_lag(int argc, char** argv);
int calibrate_camera(int argc, char** argv);
int calibrate_body(int argc, char** argv);

}  // namespace sonocase::pipeline::inline verbs
