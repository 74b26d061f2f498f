// SPDX-License-Identifier: Apache-2.0

// Synthetic recordings of calibration motions with known answers.
#pragma once

#include <vector>

#include "formats/base/constants.h"
#include "formats/recording/poses.h"
#include "support/random.h"

namespace sonocase::testing {

struct PivotMotion {
    int poses = 100;
    double tilt_rad = 60 * kRadPerDeg / 2;  // half of the full cone
    double twist_rad = kPi;                 // about the tool's own axis, each way
    double noise_mm = 0;                    // uniform, half-width, on positions
    double gaussian_mm = 0;                 // standard deviation a component
    Vector3 tip_mm{-17.78, 1.11, -156.87};
    Point3 pivot_mm{146.9, -62.97, -1042.14};
};

// Independent poses about the pivot, the tool tilted uniformly over a cone and twisted.
inline std::vector<Pose> pivot_recording(const PivotMotion& motion, Random& random) {
    std::vector<Pose> poses;
    const Matrix3 rest = random.rotation();
    const Vector3 axis = normalized(rest * motion.tip_mm);
    const Vector3 side = any_perpendicular(axis);
    for (int i = 0; i < motion.poses; ++i) {
        const double around = random.uniform(-kPi, kPi);
        const Vector3 hinge = rotation_about(axis, around) * side;
        const double tilt = motion.tilt_rad * std::sqrt(random.uniform(0, 1));
        const double twist = random.uniform(-motion.twist_rad, motion.twist_rad);
        Pose pose;
        pose.frame = i;
        pose.timestamp_s = i / 60.0;
        pose.ok = true;
        pose.tracker_from_tool.rotation =
            nearest_rotation(rotation_about(hinge, tilt) * rotation_about(axis, twist) * rest);
        Point3 p = motion.pivot_mm - pose.tracker_from_tool.rotation * motion.tip_mm;
        for (int c = 0; c < 3; ++c) {
            p[c] += random.uniform(-motion.noise_mm, motion.noise_mm) +
                    motion.gaussian_mm * random.gaussian();
        }
        pose.tracker_from_tool.translation = {p.x, p.y, p.z};
        poses.push_back(pose);
    }
    return poses;
}

}  // namespace sonocase::testing
