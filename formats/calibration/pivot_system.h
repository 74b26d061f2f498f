// SPDX-License-Identifier: Apache-2.0

// The pivot problem over chosen poses, in two forms: sums for the search, orthogonal for the
// answer. Internal to formats/calibrate.
#pragma once

#include <span>
#include <vector>

#include "formats/calibration/least_squares.h"
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
    // |(R - Rm) t + (p - pm)|^2 summed.
    double residual(Vector3 tip) const;
    Point3 pivot(Vector3 tip) const;  // Rm t + pm
};

// x with A x = b for a symmetric positive definite A; false if it is singular to working precision.
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

// Deterministic stream of indices, the same on every platform.
class IndexStream {
  public:
    explicit IndexStream(std::uint64_t seed) : state_(seed) {}
    std::size_t below(std::size_t count) {
        state_ += 0x9e3779b97f4a7c15ull;
        std::uint64_t z = state_;
        z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9ull;
        z = (z ^ (z >> 27)) * 0x94d049bb133111ebull;
        z ^= z >> 31;
        return static_cast<std::size_t>(z % count);
    }

  private:
    std::uint64_t state_;
};

// Poses of the densest half: tip of the least-trimmed-squares fit (random triples, concentration
// steps). False if no triple determines a tip. Poses' positions centred.
bool search_tip(std::span<const Pose> poses, int trials, std::uint64_t seed, Vector3* tip);

// Groups of successive poses, each resting on its own point, that one tip explains; empty if none.
std::vector<PoseGroup> search_rests(std::span<const Pose> poses, std::uint64_t seed);

// Runs as in find_rests, as indices.
std::vector<PoseGroup> runs_at_rest(std::span<const Pose> poses,
                                    Vector3 tip,
                                    double radius_mm,
                                    std::size_t min_poses);

}  // namespace sonocase::calibrate
