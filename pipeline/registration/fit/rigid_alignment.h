// SPDX-License-Identifier: Apache-2.0

// Rigid alignment of the patient's skin to the mannequin: iterative closest points from many
// starts.
//
// Source: the paper's second stage ("multiple (randomly selected) starting offsets and rotations").
// Departures: starts are spread evenly over all rotations, in the readings' own axes: nothing is
// drawn at random, and the tracker's frame does not matter; gaps
// are point-to-plane in both directions with a robust weight, which needs a sixth of the iterations
// and ends closer; points without a counterpart count in the score, so that sliding off an open,
// longer or partly swept mannequin does not pay. Several distinct candidates are returned: a torso
// is nearly a cylinder, and which end is up is decided later, or by a hint.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "formats/base/geometry.h"
#include "pipeline/base/progress.h"
#include "pipeline/registration/fit/matching.h"

namespace sonocase::pipeline::inline registration_fit {

// What the user knows in addition to the surfaces; frames relative to their origins.
struct PoseHints {
    std::optional<Vector3> up;  // the patient's head direction (skin z) on the mannequin; unit
    struct Place {
        Point3 skin, target;
    };
    std::vector<Place> landmarks;
    // Weight of |head - up|^2: 15 degrees cost as much as gaps of 4.5 mm everywhere.
    double up_weight_mm2 = 300;
    // Weight of each squared distance, against the mean squared gap.
    double landmark_weight = 0.02;
    std::optional<Vector3> back;  // where the patient's back (skin -y) lies on the mannequin; unit
    double back_weight_mm2 = 0;   // of |back of the pose - back|^2

    double back_cost_mm2(const Rigid& pose) const;
    double cost_mm2(const Rigid& pose) const;  // distances beyond 60 mm count as 60
};

struct RigidOptions {
    int starts = 96;        // rotations, >= 1
    int offsets = 3;        // along the patient's long axis for each rotation, >= 1
    double offset_mm = 45;  // between these
    int coarse_iterations = 8;
    int coarse_points = 120;  // of either surface
    int kept = 14;            // refined on fine_points
    int fine_iterations = 25;
    int fine_points = 700;
    int candidates = 6;  // returned
    PoseHints hints;
    double cone_rad = 0.7;  // with hints.up: largest tilt of the head from it
};

struct RigidCandidate {
    Rigid target_from_skin;  // between the frames relative to their origins
    double score_mm = 0;     // root of the mean penalty over both surfaces
    double coverage = 0;     // share of readings with a counterpart
    int found = 0;           // starts that ended near it; 0: it comes from elsewhere
};

// Whether a pose that reaches this share of the readings has slid off them: another reaches more
// than twice as many. Its gaps are the least where the missing counterparts cost no more than they.
inline bool slid_off(double coverage, double best_coverage) {
    return coverage < 0.5 * best_coverage;
}

// Distinct candidates (more than 20 degrees or 40 mm apart), best score first; never empty.
std::vector<RigidCandidate> align_rigid_candidates(const SkinModel& skin,
                                                   const TargetSurface& target,
                                                   const RigidOptions& options,
                                                   const Progress& progress = {});

// The nearest minimum from a start.
RigidCandidate refine_rigid(const SkinModel& skin,
                            const TargetSurface& target,
                            const Rigid& start,
                            const RigidOptions& options);

// The same minimum by Ceres: Cauchy loss on gaps, matches renewed at most `rounds` times. Matches
// change in steps, so that a descent rests at one of several poses some 0.1 mm apart, and the warps
// make 0.6 mm inside the body of that. It is therefore run twice, the second time from the pose
// rounded to 2 mm and some 0.3 degrees, which descents from different starts have in common.
Rigid refine_rigid_robust(const SkinModel& skin,
                          const TargetSurface& target,
                          const Rigid& start,
                          const PoseHints& hints,
                          double loss_mm,
                          int rounds);

// Whether two poses differ by less than angle_rad and, at the skin's origin, shift_mm.
bool same_pose(const Rigid& a, const Rigid& b, double angle_rad, double shift_mm);

}  // namespace sonocase::pipeline::inline registration_fit
