// SPDX-License-Identifier: Apache-2.0

// The pivot problem over chosen poses, and the choice of those poses. Internal to
// formats/calibration.
//
// It is solved in two forms: PivotSums, a few additions per pose, for the search; solve_pivots, an
// orthogonal factorisation, for the answer. The searches are robust and take random samples; the
// same poses and seed give the same answer on every machine.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "formats/calibration/least_squares.h"
#include "formats/calibration/point.h"
#include "formats/recording/poses.h"

namespace sonocase::calibrate {

// Sums over poses from which tip and residual follow. R^T R = I makes the normal matrix
// n (I - Rm^T Rm), so a pose costs a few additions. Positions should be centred beforehand.
struct PivotSums {
    double n = 0;
    Matrix3 rotation = {{0, 0, 0, 0, 0, 0, 0, 0, 0}};  // sum of R
    Vector3 position;                                  // sum of p
    Vector3 turned;                                    // sum of R^T p
    double square = 0;                                 // sum of |p|^2

    void add(const Rigid& pose);
    void add(const PivotSums& other);
    Matrix3 normal() const;  // sum (R - Rm)^T (R - Rm)
    Vector3 right() const;   // -sum (R - Rm)^T (p - pm)
    double spread() const;   // sum |p - pm|^2
    // sum |(R - Rm) t + (p - pm)|^2
    double residual(Vector3 tip) const;
    Point3 pivot(Vector3 tip) const;  // Rm t + pm
};

// Solves A x = b for a symmetric positive definite A; false if it is singular to working precision.
bool solve_symmetric(const Matrix3& a, Vector3 b, Vector3* x);

// Groups of poses that share the tip, each with its own pivot.
using PoseGroup = std::vector<std::size_t>;

struct PivotSolution {
    LeastSquaresFit fit;  // unknowns: tip
    Vector3 tip;
    std::vector<Point3> pivots;          // # groups
    std::vector<Matrix3> mean_rotation;  // # groups
    double residual_sum = 0;
    std::int64_t poses = 0;
};

PivotSolution solve_pivots(std::span<const Pose> poses,
                           std::span<const PoseGroup> groups,
                           double rank_tolerance = 1e-12);

// Tip of the least-trimmed-squares fit: the one with the smallest mean square residual over the
// better half of the poses (random triples, then concentration steps). False if no triple
// determines a tip. Positions must be centred beforehand.
bool search_tip(std::span<const Pose> poses, int trials, std::uint64_t seed, Vector3* tip);

// Groups of successive poses, each resting on its own point, that share one tip; empty if none.
std::vector<PoseGroup> search_rests(std::span<const Pose> poses, std::uint64_t seed);

// Maximal runs of at least min_poses during which the tip stays within radius_mm of its mean.
std::vector<PoseGroup> runs_at_rest(std::span<const Pose> poses,
                                    Vector3 tip,
                                    double radius_mm,
                                    std::size_t min_poses);

PoseGroup all_poses(std::size_t count);

// The poses that the point calibration uses: those that rest on one point, without outliers; or one
// group per resting point, where the options allow several and these explain the recording far
// better. There is at least one group, and none is empty. Poses screened, positions centred.
std::vector<PoseGroup> resting_poses(std::span<const Pose> poses, const PointOptions& options);

// Standard deviation of one coordinate of the residuals, allowing for the fitted unknowns.
double residual_sigma_mm(const PivotSolution& s, std::size_t groups);

}  // namespace sonocase::calibrate
