// SPDX-License-Identifier: Apache-2.0

// The rigid motion (with one uniform scale on request) between points known in two frames: where
// the mannequin is today, from landmarks touched on it or from a sweep of its skin.
#pragma once

#include <array>
#include <span>
#include <string>
#include <vector>

#include "formats/base/geometry.h"
#include "formats/volume/surface.h"

namespace sonocase {

struct RigidFitOptions {
    bool fit_scale = false;
    bool reject_outliers = true;
};

// to = scale * rotation * from + translation.
struct RigidFit {
    Rigid to_from;  // scale is applied to `from` first
    double scale = 1;
    double scale_seen = 1;  // best uniform scale, whether used or not
    double rms_mm = 0;      // of the used points
    double condition = 0;   // of the scaled Jacobian; infinite if a motion is undetermined
    Vector3 sigma_mm;       // one standard deviation of the translation at the points' centroid
    Vector3 sigma_rad;      // one standard deviation of the rotation
    double sigma_scale = 0;
    int points = 0, inliers = 0;
    bool determined = false;
    std::string problem;
    std::vector<double> residuals_mm;  // # points
    std::vector<bool> used;            // # points
    std::vector<std::string> warnings;

    Point3 centroid_from;
    // Covariance of (rotation vector, translation at the centroid, scale), row by row, 7 x 7.
    std::array<double, 49> covariance{};

    Point3 map(Point3 from) const;
    // One standard deviation of a mapped point, root of the trace: the error to expect at a target.
    double target_sigma_mm(Point3 from) const;
};

// Points in pairs; `names` may be empty. Never fails. Quaternion fit [Horn 1987], refined by
// Gauss-Newton steps with QR. Warns of wrong pairs, exchanged pairs and a mirror image.
RigidFit fit_rigid(std::span<const Point3> from,
                   std::span<const Point3> to,
                   std::span<const std::string> names = {},
                   const RigidFitOptions& options = {});

struct SweepOptions {
    bool fit_scale = false;
    double trim = 0.1;  // share of the readings with the largest distance that is left out
    int iterations = 40;
    // Without a start every orientation is tried, and a warning says if the answer is not unique.
    bool has_start = false;
    Rigid start;  // to_from
};

// Registers readings of the skin (`to` frame, one point on the surface each) with the surface
// (`from` frame): point-to-plane ICP on the nearest surface points, which must be at most 10 mm
// apart. Cost: 40 ms for 1,000 readings with a start.
RigidFit fit_skin_sweep(const Surface& from,
                        std::span<const Point3> to,
                        const SweepOptions& options = {});

}  // namespace sonocase
