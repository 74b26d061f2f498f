// SPDX-License-Identifier: Apache-2.0

// Registration as a whole: maps the patient's skin onto the mannequin, proves that the map does not
// fold, and reports how good it is and what the data leave undetermined.
//
//   rigid starts -> candidates -> quadratic of each -> the best, its runner-up, its mirror, the
//   head the other way -> point-to-surface quadratic -> residual warp, or the elastic warp where
//   bodies differ by more than that can close -> proofs, measures, warnings
//
// The seed draws the samples of the paper's random consensus, nothing else: the map is the same for
// any seed and in any frame of the tracker.
//
// The data do not fully determine the orientation of a torso: upside-down and rolled fits score
// within a few per cent. Candidates are compared after a quadratic, and points without a
// counterpart count; a runner-up within 10 % becomes a warning that names the ambiguity and the
// hint that resolves it. What the skin does not tell of head and feet, right and left, front and
// back is one warning, and a mannequin that moved while it was swept another. Cost: 1 s on two
// cores for 2,000 readings, 2 s with the elastic warp. Same bytes for any number of threads.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "formats/base/result.h"
#include "formats/volume/label_volume.h"
#include "formats/volume/surface.h"
#include "pipeline/base/progress.h"
#include "pipeline/registration/elastic/elastic_warp.h"
#include "pipeline/registration/elastic/organ_change.h"
#include "pipeline/registration/fit/fit_measure.h"
#include "pipeline/registration/fit/quadratic_warp.h"
#include "pipeline/registration/fit/residual_warp.h"
#include "pipeline/registration/fit/rigid_alignment.h"
#include "pipeline/registration/map/registration.h"
#include "pipeline/registration/skin/skin_surface.h"

namespace sonocase::pipeline::inline registration {

inline constexpr int kRegisterVersion = 10;

// The same point of the body on both surfaces, e.g. navel or crotch.
struct Landmark {
    std::string name;
    Point3 ct, mannequin;
};

struct RegisterInput {
    const SkinSurfaceResult& skin;  // ct
    const Surface& mannequin;       // readings or a mesh, mannequin frame
    // The patient's tissues, for the elastic warp and the change of organs; null: one tissue, and
    // no changes are reported.
    const LabelVolume* labels = nullptr;
};

struct RegisterOptions {
    TargetOptions target;
    RigidOptions rigid;       // `up` here is overwritten by that below
    RansacOptions ransac;     // of paper_warp alone
    bool paper_warp = false;  // RANSAC and re-estimation, eqs. (3)-(9), and nothing more
    // Weight of eqs. (4)-(6) in mm. 0: sqrt(2) e / strain with the standard error e of the gaps,
    // so that directions which the readings determine are hardly constrained, and the others are.
    double constraint_mm = 0;
    double strain = 0.03;  // expected slopes of the map beyond a rotation, standard deviation
    double min_constraint_mm = 0.3;
    double wanted_det = 0.35;  // a weight whose proven det J is below this is rejected
    bool residual_warp = true;
    // Which displacement follows the quadratic. auto: the residual warp where it suffices
    // (warp_fit.h), else the elastic warp; residual, elastic: that one.
    std::string path = "auto";
    ResidualOptions residual;
    ElasticOptions elastic;
    // Which side of the patient the open side of the sweep is: auto (the back, unless landmarks say
    // the front), back, front, or none: it is not considered.
    std::string open_side = "auto";
    std::optional<Vector3> up;  // the patient's head direction in the mannequin frame
    double landmark_mm = 4;  // of each landmark and axis, standard deviation, both sides together
    std::vector<Landmark> landmarks;
    std::uint64_t seed = 1;
    // What the readings leave open, structure by structure, from refits to halves of the readings
    // as well as from the fit's own covariance (fit_unknown.h); off: from the covariance alone.
    std::string uncertainty = "off";  // "on"
    int refits = 12;                  // >= 2
};

enum class PoseKind { shifted, tilted, rolled, upside_down };

struct RunnerUp {
    PoseKind kind = PoseKind::shifted;  // relative to the chosen pose
    double score_mm = 0, coverage = 0;
    double turn_deg = 0;  // from the chosen pose
    double shift_mm = 0;
    std::string described;  // "upside down", "front to back", ...
};

// Root mean square over a structure, mm: half, 90 % and 95 % of the maps that the readings allow
// carry it less far from here.
struct Spread {
    double median_mm = 0, p90_mm = 0, p95_mm = 0;
};

// How far from its true place a structure may lie on the mannequin. Its own Spread is what is said:
// the larger of the two.
struct OrganUnknown : Spread {
    std::string label;
    Spread covariance;         // of the Gauss-Newton system
    Spread refits;             // to halves of the readings; zero: not asked for
    double halves_p90_mm = 0;  // nine in ten of the refits carry it less far; 0: not asked for
    double p90_with_landmarks_mm = 0;  // if two landmarks were given; 0: some are
};

struct RegisterResult {
    Registration registration;  // reports: align, warp
    FitMeasure rigid_fit, quadratic_fit, fit;
    std::vector<RunnerUp> runners_up;   // best first
    std::vector<OrganChange> organs;    // what the map does to each label; empty without labels
    std::vector<OrganUnknown> unknown;  // of each label; empty without labels or a fitted quadratic
    StageReport report;                 // stage "register": everything, as --report shows it
};

// Errors: a mannequin surface that cannot be fitted to (see prepare_target), a bad hint.
Result<RegisterResult> register_surfaces(const RegisterInput& input,
                                         const RegisterOptions& options = {},
                                         const Progress& progress = {});

// Single stages. align: a registration whose map is rigid. warp: from such a registration.
Result<RegisterResult> align_surfaces(const RegisterInput& input,
                                      const RegisterOptions& options = {},
                                      const Progress& progress = {});
Result<RegisterResult> warp_surfaces(const RegisterInput& input,
                                     const Rigid& mannequin_from_ct,
                                     const RegisterOptions& options = {},
                                     const Progress& progress = {});

// Which of several mannequins fits a patient best.
//
// How a fit compares with a good one: each figure over what is good, so that 1 or less is good.
struct Misfit {
    double skin = 0;      // 95th percentile of readings to skin over 2.7 mm
    double volume = 0;    // largest change of a solid organ or of all bones over 8 %
    double shape = 0;     // largest change of the shape of a solid organ over 0.2
    double coverage = 0;  // 0.6 over the share of readings with a counterpart
    bool proven = true;   // free of folds and one to one
    double worst() const;
};
Misfit misfit_of(const RegisterResult& result);

// Indices of the results, best first: proven maps before others, then by the worst figure.
std::vector<std::size_t> rank_results(const std::vector<RegisterResult>& results);

}  // namespace sonocase::pipeline::inline registration
