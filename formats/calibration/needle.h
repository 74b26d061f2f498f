// SPDX-License-Identifier: Apache-2.0

// Axis and tip of a needle in the frame of the sensor at its hub.
//
// Pinholes   The needle is pushed through a fixed hole to several depths and tilted at each: one
//            pivot calibration per depth gives one point of the axis. The paper takes the points'
//            principal direction and the mean of what is left of them after projection; both are
//            reported. The answer weights each point by its own covariance, which equals the joint
//            fit of all readings.
// Spin       The needle is spun in a groove: the axis is the direction that does not turn.
// Both       One pivot with the tip itself on a fixed point, and one spin: tip by the pivot, axis
//            by the spin, from the sensor to the tip.
#pragma once

#include <span>
#include <string>
#include <vector>

#include "formats/calibration/point.h"

namespace sonocase {

struct NeedleOptions {
    // Distance from the hole to the tip for each recording, mm. Empty: not measured; the point of
    // the axis farthest from the sensor is taken as the tip.
    std::vector<double> depths_mm;
    PointOptions point{};
};

struct NeedleFit {
    Vector3 direction{0, 0, 1};  // sensor frame, unit, hub to tip
    Vector3 axis_point_mm;       // sensor frame: the point of the axis nearest to the sensor
    Vector3 tip_mm;              // sensor frame
    bool tip_measured = false;   // false: only the axis is known, tip_mm is the farthest point
    double direction_sigma_rad = 0;
    Vector3 tip_sigma_mm;
    double rms_mm = 0;  // distance of the points (spin: of the readings) from the axis
    double condition = 0;
    int poses = 0, inliers = 0;

    Vector3 paper_direction{0, 0, 1};  // principal component of the points
    Vector3 paper_point_mm;            // mean of the points minus their projections

    bool determined = false;
    std::string problem;
    std::vector<PointFit> points;  // one per recording; spin: none
    std::vector<std::string> warnings;

    Rigid sensor_from_needle() const;  // origin at the tip, z along the direction
};

// One recording per depth. Never fails.
NeedleFit fit_needle(std::span<const std::vector<Pose>> recordings,
                     const NeedleOptions& options = {});

// Fits a spin, which determines the axis but neither the tip (tip_mm is axis_point_mm) nor the sign
// of the direction. Never fails.
NeedleFit fit_needle_spin(std::span<const Pose> poses);

// Joins a pivot of the tip with a spin. Not determined if either is not, or if the tip is so near
// to the sensor along the axis that the sign is not known; a warning if the tip lies off the axis.
NeedleFit join_pivot_and_spin(const PointFit& pivot, const NeedleFit& spin);

struct NeedleAgreement {
    double angle_rad = 0;    // between the directions
    double distance_mm = 0;  // of the first tip from the second axis
    bool agree = false;      // within 1 degree and 1 mm, or three standard deviations
    std::string sentence;
};
NeedleAgreement compare(const NeedleFit& pinholes, const NeedleFit& spin);

}  // namespace sonocase
