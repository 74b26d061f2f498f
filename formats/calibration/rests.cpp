// SPDX-License-Identifier: Apache-2.0

#include <cmath>

#include "formats/calibration/point.h"
#include "formats/calibration/solve/pivot_search.h"

namespace sonocase {

using calibrate::PoseGroup;

std::vector<Point3> tip_trace(std::span<const Pose> poses, Vector3 tip_mm) {
    std::vector<Point3> trace;
    trace.reserve(poses.size());
    for (const Pose& p : poses) {
        trace.push_back(p.tracker_from_tool * Point3{tip_mm.x, tip_mm.y, tip_mm.z});
    }
    return trace;
}

std::vector<RestPoint> find_rests(std::span<const Pose> poses,
                                  Vector3 tip_mm,
                                  const RestOptions& options) {
    std::vector<RestPoint> rests;
    const std::vector<Point3> trace = tip_trace(poses, tip_mm);
    for (const PoseGroup& run : calibrate::runs_at_rest(
             poses, tip_mm, options.radius_mm, static_cast<std::size_t>(options.min_poses))) {
        const auto n = static_cast<double>(run.size());
        Vector3 sum;
        for (std::size_t i : run) sum = sum + (trace[i] - trace[run[0]]);
        RestPoint rest;
        rest.pivot_mm = trace[run[0]] + sum / n;
        double square = 0;
        for (std::size_t i : run) {
            const Vector3 r = trace[i] - rest.pivot_mm;
            square += dot(r, r);
        }
        rest.rms_mm = std::sqrt(square / n);
        const double sigma = rest.rms_mm / std::sqrt(3 * n);
        rest.sigma_mm = {sigma, sigma, sigma};
        rest.first_frame = poses[run.front()].frame;
        rest.last_frame = poses[run.back()].frame;
        rest.poses = static_cast<int>(run.size());
        rests.push_back(rest);
    }
    return rests;
}

}  // namespace sonocase
