// SPDX-License-Identifier: Apache-2.0

// Directions of a tool in the frame of its sensor, from one sweep along each: the user moves the
// tool along the direction and holds its orientation. Two sweeps give the probe's frame.
//
// [Magee] eq. (14) takes successive pairs of readings, each a unit vector V_n, and projects them
// into (S_dir, S_ori, S_3). Pairs that lie close together are mostly noise, and a hand moves back
// and forth. Here a straight line is fitted robustly to the path in the tracker's frame and
// projected into the sensor's frame at every reading; the paper's form is kept for comparison.
#pragma once

#include <span>
#include <string>
#include <vector>

#include "formats/calibration/point.h"
#include "formats/recording/poses.h"

namespace sonocase {

struct DirectionOptions {
    Vector3 tip_mm;  // point of the tool whose path is followed, sensor frame
    bool reject_outliers = true;
    double outlier_sigmas = 5;  // > 3
    int trials = 200;
    std::uint64_t seed = 1;
};

struct DirectionFit {
    Vector3 direction{0, 0, 1};  // sensor frame, unit; points the way the sweep went first
    double sigma_rad = 0;  // one standard deviation about either axis; infinite if undetermined
    double rms_mm = 0;     // distance from the line
    double length_mm = 0;  // of the path along the line
    double turn_rad = 0;   // rms change of orientation about its mean
    double condition = 0;  // ratio of the spread along the line to the spread across it
    bool back_and_forth = false;  // the sweep reversed
    int poses = 0, inliers = 0;
    bool determined = false;
    std::string problem;
    std::vector<PoseResidual> residuals;  // # poses; distance from the line
    std::vector<std::string> warnings;
};

// Never fails; poor data give determined == false or warnings. Cost: 5 ms for 1,000 poses.
DirectionFit fit_direction(std::span<const Pose> poses, const DirectionOptions& options = {});

// Eq. (14) as printed: the mean over successive pairs at least min_step_mm apart. Screened poses.
Vector3 fit_direction_paper(std::span<const Pose> poses, double min_step_mm = 1);

struct ProbeFrame {
    Matrix3 sensor_from_probe;  // columns: lateral x, elevation y, depth z
    double raw_angle_rad = 0;   // between the two directions as measured
    double sigma_rad = 0;       // of the frame's worst axis
    bool determined = false;
    std::string problem;
    std::vector<std::string> warnings;
};

// Makes the two directions orthogonal by turning each by a share of the error in proportion to its
// variance; elevation is depth x lateral.
ProbeFrame make_probe_frame(const DirectionFit& depth, const DirectionFit& lateral);

}  // namespace sonocase
