// SPDX-License-Identifier: Apache-2.0

#include "formats/calibration/point_warnings.h"

#include <algorithm>
#include <cmath>

#include "formats/calibration/report_text.h"
#include "formats/calibration/resting_poses.h"

namespace sonocase::calibrate {
namespace {

// If transposed rotations explain the recording far better, the export wrote them by columns.
void hint_at_conventions(std::span<const Pose> poses, double sigma, PointFit& out) {
    if (poses.size() < 10 || sigma < 2) return;
    std::vector<Pose> turned(poses.begin(), poses.end());
    for (Pose& p : turned) p.tracker_from_tool.rotation = transpose(p.tracker_from_tool.rotation);
    const PoseGroup all = all_poses(poses.size());
    const double plain = residual_sigma_mm(solve_pivots(poses, std::span(&all, 1)), 1);
    if (residual_sigma_mm(solve_pivots(turned, std::span(&all, 1)), 1) < 0.25 * plain) {
        out.warnings.push_back(
            "The readings fit far better with every rotation transposed; the export "
            "writes rotations column by column: write them row by row.");
    }
}

void warn_of_left_out_poses(PointFit& out) {
    if (out.rests.size() > 1) {
        out.warnings.push_back(
            text("The tip rests on %zu points in turn (%d of %d poses); they were fitted "
                 "together with one tip.",
                 out.rests.size(), out.inliers, out.poses));
        return;
    }
    if (out.inliers == out.poses) return;
    const double share = 100.0 * (out.poses - out.inliers) / out.poses;
    std::string consequence;
    if (share > 40) {
        consequence = "; with so many the answer is doubtful: record again with the tip held fast";
    } else if (out.left_out_shift_mm > out.left_out_sigma_mm) {
        consequence = text(
            "; with them the tip would lie %.2g mm away, more than one standard deviation (%.2g "
            "mm): check those poses on the picture, or record 100 poses or more",
            out.left_out_shift_mm, out.left_out_sigma_mm);
    }
    out.warnings.push_back(
        text("%d of %d poses (%.0f %%) do not rest on the common point and are left out%s.",
             out.poses - out.inliers, out.poses, share, consequence.c_str()));
}

// Positions in other units, and poses seen from the other side: both give a plausible fit.
void warn_of_units_and_inverse_poses(PointFit& out) {
    if (norm(out.tip_mm) < 2 && out.swing.x > 0.05) {
        out.warnings.push_back(
            text("The tip lies only %.3f mm from the sensor; if positions are in metres "
                 "or inches, export them in mm.",
                 norm(out.tip_mm)));
    }
    // Inverse poses are a pivot recording too, with tip and pivot exchanged: only the lengths
    // differ.
    const Point3 zero{};
    if (norm(out.tip_mm) > 500 && distance(out.pivot_mm, zero) < 0.5 * norm(out.tip_mm)) {
        out.warnings.push_back(text(
            "The tip lies %.0f mm from the sensor, farther than the pivot from the tracker; if "
            "these are inverse poses (the tracker seen from the tool), export the tool seen from "
            "the tracker.",
            norm(out.tip_mm)));
    }
}

}  // namespace

void judge_motion(double sigma, double widest, std::size_t poses, PointFit& out) {
    // A resting tracker shows 0.2 degrees rms; a swing below a two-hundredth of the largest one is
    // that one's noise.
    constexpr double kStill = 0.2 * kDegree, kShare = 0.005;
    if (poses < 3) {
        out.problem = text(
            "%zu usable pose%s; at least 3 are needed and 30 or more are better: rest the "
            "tip on a fixed point and tilt the tool every way",
            poses, poses == 1 ? "" : "s");
        return;
    }
    if (widest < kStill) {
        out.problem = text(
            "the sensor stood still (it turned by %.2f degrees), so the tip cannot be "
            "found; keep the tip on a fixed point and tilt the tool 30 degrees or "
            "more every way",
            widest / kDegree);
        return;
    }
    const double least = out.swing.z;
    if (least < 0.5 * kStill || least < kShare * out.swing.x) {
        out.problem =
            "rotation so far is about one axis, " + axis_text(out.weak_axis) +
            " of the sensor, and the tip is undetermined along it; tilt the tool sideways as "
            "well, about another axis";
        return;
    }
    out.determined = true;
    if (out.weak_sigma_mm > 0.5 || least < 3 * kDegree) {
        out.warnings.push_back(text(
            "The tip is known least along %s of the sensor: one standard deviation is %.2g mm, the "
            "tool swung only %.1f degrees rms across it; tilt it further, at right angles to that "
            "axis.",
            axis_text(out.weak_axis).c_str(), out.weak_sigma_mm,
            std::asin(std::min(1.0, least)) / kDegree));
    }
    if (sigma > 2) {
        out.warnings.push_back(
            text("Residuals are large (%.1f mm rms); the tip slid on its resting point, "
                 "the sensor is loose, or metal disturbs the tracker: fix that and "
                 "record again.",
                 sigma));
    }
}

void warn_of_doubtful_answer(std::span<const Pose> poses, double sigma, PointFit& out) {
    warn_of_left_out_poses(out);
    if (out.poses < 10) {
        out.warnings.push_back(text("Only %d poses; take 30 or more.", out.poses));
    }
    warn_of_units_and_inverse_poses(out);
    hint_at_conventions(poses, sigma, out);
}

}  // namespace sonocase::calibrate
