// SPDX-License-Identifier: Apache-2.0

// Pivot calibration: where the tip of a tool is in the frame of its sensor, from a recording in
// which the tip rests on a fixed point while the tool is tilted every way. The paper's probe point
// is the same problem and is solved here too.
//
//     R_i t + p_i = c        unknown t (tip, sensor frame) and c (pivot, tracker frame)
//
// [Magee] eqs. (11)-(13): with S_pos = p, S_dir and S_ori the first two columns of R,
// t = (d1, d2 cos theta, d2 sin theta). The printed (13) is wrong: the column of d1 is -S_dir, and
// rows 2 and 3 of the last column are -(S_dir x S_ori)_y and _z. See docs/equations.md.
//
// The pivot is eliminated by centring, (R_i - R_mean) t = -(p_i - p_mean), so that a far
// origin costs no accuracy. The singular values of the centred system, divided by sqrt(N), are
// called swing: how far the tool turned at right angles to each direction, about the rms sine of
// the tilt.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "formats/recording/poses.h"

namespace sonocase {

enum class RestSearch {
    one,        // all poses rest on one point
    automatic,  // one, or several if one point explains the recording badly
    several     // several resting points, with moves between them
};

struct PointOptions {
    RestSearch rests = RestSearch::automatic;
    bool reject_outliers = true;
    // A pose is left out beyond this many robust standard deviations, > 3.
    double outlier_sigmas = 5;
    int trials = 100;  // random starts of the robust fit, >= 1
    std::uint64_t seed = 1;
};

struct PoseResidual {
    std::int64_t frame = 0;
    double timestamp_s = 0;
    double residual_mm = 0;  // |R t + p - c|
    bool inlier = false;
    int rest = -1;  // which resting point; -1: none
};

struct RestPoint {
    Point3 pivot_mm;  // tracker frame
    Vector3 sigma_mm;
    double rms_mm = 0;
    std::int64_t first_frame = 0, last_frame = 0;
    int poses = 0;
};

struct PointFit {
    Vector3 tip_mm;   // sensor frame; the undetermined part, if any, is zero
    Point3 pivot_mm;  // tracker frame; of the resting point with the most poses
    // The paper's unknowns: d2 >= 0, theta in (-pi, pi].
    double d1_mm = 0, d2_mm = 0, theta_rad = 0;

    double rms_mm = 0;  // of the inliers' residuals |R t + p - c|
    Vector3 sigma_mm;   // one standard deviation of the tip; infinite where undetermined
    Vector3 pivot_sigma_mm;
    double condition = 0;    // of the 3 N x 6 system in (t, c); infinite if singular
    double correlation = 0;  // between residuals of successive poses; the sigmas allow for it
    int poses = 0;           // usable readings
    int inliers = 0;         // how many of them were used

    // How far the answer depends on the poses that were left out: the distance from the tip to the
    // least-squares tip of all usable poses, and the tip's standard deviation in that direction.
    // Zero if none was left out; negative: not measured (several resting points, or undetermined).
    double left_out_shift_mm = -1;
    double left_out_sigma_mm = 0;

    bool determined = false;  // false: `problem` says why not and what to do
    std::string problem;
    Vector3 swing;             // in decreasing order; see above
    Vector3 weak_axis;         // sensor frame, unit: the direction that is determined worst
    double weak_sigma_mm = 0;  // one standard deviation along it

    std::vector<RestPoint> rests;         // at least one if determined
    std::vector<PoseResidual> residuals;  // # poses
    std::vector<std::string> warnings;
};

// Screens the readings (pose_screen.h), fits, and reports how good the answer is. Never fails: poor
// data give determined == false or warnings. The sigmas assume equal, independent position noise
// and are widened by the correlation of successive residuals. The same readings and options give
// the same bytes. Cost: 10 ms for 1,000 poses.
PointFit fit_point(std::span<const Pose> poses, const PointOptions& options = {});

// The paper's own system, eqs. (11)-(12) in matrix form: six unknowns, every pose used. Slow and
// simple; kept for comparison with fit_point. Takes screened poses; returns
// {d1, d2 cos theta, d2 sin theta}.
Vector3 fit_point_paper(std::span<const Pose> poses, Point3* pivot_mm = nullptr);

// Position of the tip in the tracker frame for every pose.
std::vector<Point3> tip_trace(std::span<const Pose> poses, Vector3 tip_mm);

// The touches in a recording whose tip is known: maximal runs of poses during which the tip stays
// within radius_mm of its mean. Runs shorter than min_poses are moves.
struct RestOptions {
    double radius_mm = 1.5;
    int min_poses = 10;
};
std::vector<RestPoint> find_rests(std::span<const Pose> poses,
                                  Vector3 tip_mm,
                                  const RestOptions& options = {});

// What else the readings may be, where a pivot fits poorly or not at all (more than 2 mm rms): the
// sentence names the reading that fits at most a third as badly, and within 2 mm. Rotations that
// were written column by column, poses that map the tracker to the tool, or a quaternion whose
// scalar came last where it was read first. Empty: none of them. Five more fits, only where the
// first is poor.
std::string misread_poses(std::span<const Pose> poses,
                          const PointFit& fit,
                          const PointOptions& options = {});

}  // namespace sonocase
