// SPDX-License-Identifier: Apache-2.0

// The quadratic warp, eqs. (3)-(9) of the paper, and its refinement from points to surfaces.
//
//   (3)  y = K b(w),  b = (1, x, y, z, xx, yy, zz, xy, xz, yz)
//   (4)-(6)  soft constraints dK b / dz = I at every data point, "an unrotated rigid mapping"
//   (7)-(8)  matches: D(v, m) = |v - m| / |v - C(v)| < T_d
//   (9)  consensus: share of mapped skin points within T_c of a mannequin point
//
// Departures. Coordinates are centred and scaled (w = R x / scale, x about the skin's origin),
// which lowers the condition number from 1e8 to 1e2. The constraint's weight is an option in mm;
// the paper's rows, in plain mm, have weight 1, and their maps fold. All three dimensions are
// solved by one QR factorisation.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "pipeline/base/progress.h"
#include "pipeline/registration/fit/matching.h"
#include "pipeline/registration/map/registration.h"

namespace sonocase::pipeline::inline registration_fit {

// A quadratic map about a rigid alignment, between the frames relative to their origins.
struct RigidQuadratic {
    Rigid rigid;
    double scale_mm = 200;
    std::array<std::array<double, 10>, 3> k{};  // mm

    static RigidQuadratic from_rigid(const Rigid& rigid);
};
Point3 map_point(const RigidQuadratic& q, Point3 skin);
Matrix3 jacobian(const RigidQuadratic& q, Point3 skin);
// The same map between the frames themselves.
QuadraticMap in_frames(const RigidQuadratic& q, Point3 skin_origin, Point3 target_origin);

struct Correspondence {
    Point3 skin, place;
};
// Eqs. (3)-(6) by least squares. constraint_mm >= 0.
RigidQuadratic fit_correspondences(std::span<const Correspondence> pairs,
                                   const Rigid& rigid,
                                   double constraint_mm);

struct RansacOptions {
    double match_ratio = 1.3;  // T_d
    int correspondences = 25;  // per trial; the paper has 20-30
    int trials = 100;
    double consensus_share =
        0.05;                   // T_c over the mean distance of mannequin points from their mean
    double constraint_mm = 15;  // weight of (4)-(6); 1 is the paper's
    int skin_points = 500;      // N_v
    std::uint64_t seed = 1;
};

struct RansacResult {
    RigidQuadratic map;
    double rigid_consensus = 0, best_trial_consensus = 0, consensus = 0;
    double consensus_mm = 0;  // T_c
    int folding_trials = 0;   // rejected: det J <= 0.2 somewhere in the box
    int best_trial = -1;      // -1: no trial beat the rigid map
    bool re_estimated = false;
};

// box  ct, relative to the skin's origin; det J > 0.2 over it is proven for every candidate.
RansacResult ransac_quadratic(const SkinModel& skin,
                              const TargetSurface& target,
                              const Rigid& rigid,
                              const Box3& box,
                              const RansacOptions& options,
                              const Progress& progress = {});

// Every n-th point, about `count` of them.
std::vector<Point3> subsample(const std::vector<Point3>& points, std::size_t count);

MappedSkin map_skin(const SkinModel& skin, const RigidQuadratic& q);

struct RefineOptions {
    double constraint_mm = 10;
    double first_loss_mm = 8, last_loss_mm = 2.5;  // Cauchy scale, from first to last iteration
    double first_gate_mm = 60, last_gate_mm = 30;  // a point farther away has no counterpart
    int iterations = 6;
    int skin_queries = 2500;
    std::vector<Correspondence> landmarks;  // each is a soft row in addition to the gaps
    double landmark_weight = 0.02;          // of its squared distance against the mean squared gap
};

struct RefineResult {
    RigidQuadratic map;
    double condition = 0;        // of the last weighted system
    double constraint_cost = 0;  // constraint_mm^2 mean |dq/dz - I|^2, mm^2
};

// Point to surface: minimises robust gaps in both directions plus the constraint.
RefineResult refine_quadratic(const SkinModel& skin,
                              const TargetSurface& target,
                              std::span<const std::uint32_t> readings,
                              const RigidQuadratic& start,
                              const RefineOptions& options);

// How far the data support a fitted quadratic.
struct QuadraticTrust {
    double sigma_mm = 0;           // robust spread of the gaps
    double standard_error_mm = 0;  // of a mean gap; gaps of one 60 mm patch count as one
    int patches = 0;
    // Of the readings' gaps: the variance of their mean over what it would be if each were a draw
    // of its own. 1: what is left is noise, and a quadratic may be true; from 4 on it is not.
    double design_effect = 1;
    double fitted_mm = 0;    // root of the mean squared gap, gaps beyond 8 mm counted as 8
    double held_out_mm = 0;  // the same, but fitted without the patch of each gap
    double inside_mm = 0;    // expected error inside the body, root mean square
    // Maps that explain the gaps as well, drawn from the posterior of the coefficients.
    std::vector<RigidQuadratic> draws;
};

// strain  the standard deviation of the map's slopes that is expected beforehand; with it and the
//         standard error e the best constraint weight is sqrt(2) e / strain, and the spread of the
//         answer follows. A surface shows little of displacements along it: the honest figure of a
//         fit is that spread, not the gaps.
// inside  skin frame, relative to its origin. Cost: about two iterations of refine_quadratic.
QuadraticTrust trust_quadratic(const SkinModel& skin,
                               const TargetSurface& target,
                               std::span<const std::uint32_t> readings,
                               const RigidQuadratic& q,
                               const RefineOptions& options,
                               double strain,
                               std::span<const Point3> inside);

// A proven lower bound of det J over a box of skin coordinates.
double proven_min_det(const RigidQuadratic& q, const Box3& box);

}  // namespace sonocase::pipeline::inline registration_fit
