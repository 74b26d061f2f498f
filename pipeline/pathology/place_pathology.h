// SPDX-License-Identifier: Apache-2.0

// Lesions, stones, fluid and the like, put into cooked labels as a recipe's [[pathology]] asks.
//
// Each is one label, NAME, and what its kind adds: NAME_halo, NAME_wall, NAME_debris, ... All are
// painted on the cooked grid, in the order of the recipe, so that the volume asked for is the
// volume that the bundle holds and no smoothing eats it. Surfaces within voxels are those of the
// shape itself (formats/volume/boundary_record.h).
//
// A shape is a rank t(x) that rises outwards, and a threshold: of the voxels that may be replaced,
// those of lowest rank become the lesion, as many as its volume asks for. The volume is therefore
// exact to half a voxel, whatever the shape. Signed distance to the surface: (t - threshold) /
// |grad t|.
//
//   ellipsoid  turned at random, axes log-uniform in 1/elongation .. elongation, radius times
//              1 + sum of zonal harmonics of degree 2 to 5 about random axes (rms `roughness`)
//   tube       along `path`, or a filled share of a vessel over `length_mm`
//   pool       fluid: the lowest voxels of the host against gravity; `beside` limits it to what
//              lies within reach_mm of each of the labels named
//   swell      grows from the middle of the host, or of the host outwards into `into`
//
// Frames: centre, near, path and directions are in `ct` unless the request says `mannequin`; the
// caller hands in the map. Gravity pulls a patient who lies on his back to the rear of the `ct`
// frame.
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "formats/base/result.h"
#include "formats/base/stage_report.h"
#include "formats/pathology/pathology_kinds.h"
#include "formats/volume/label_volume.h"
#include "formats/volume/surface_patch.h"
#include "formats/volume/tissue.h"
#include "pipeline/base/progress.h"

namespace sonocase::pipeline::inline pathology {

inline constexpr int kPathologyVersion = 1;  // raised when the same input gives another output
inline constexpr int kPlacementTries = 400;

// One [[pathology]] of a recipe. Negative numbers stand for the values of the kind.
struct PathologyRequest {
    std::string name;
    std::string kind;               // a row of pathology_kinds()
    std::vector<std::string> host;  // labels that it lies in
    std::vector<std::string> into;  // swell: labels that it may grow into; empty: stays in its host
    std::vector<std::string> beside;  // pool: both must lie within reach_mm
    double volume_ml = 0;             // within its surface, parts inside included; halo and wall
                                      // lie outside
    double diameter_mm = 0;           // of the ball of that volume, instead of volume_ml
    double elongation = -1;           // [1, 3]
    double roughness = -1;            // [0, 0.3]
    double depth_low_mm = 0, depth_high_mm = 1e9;  // nearest point below the skin
    double capsule_mm = 3, vessel_mm = 2, apart_mm = 5;
    bool in_mannequin = false;  // frame of the points below
    std::optional<Point3> centre;
    std::optional<Point3> near;  // the centre lies within near_mm of it
    double near_mm = 30;
    std::vector<Point3> path;  // tube
    double length_mm = 40;     // tube in a vessel
    double share = 1;          // tube in a vessel: of the lumen that is filled
    double reach_mm = 12;      // pool
    double mass_effect = 0;    // share of its volume that pushes neighbours aside, [0, 1]
    double reach = 2.5;        // radii to which they are pushed
    int seed = 1;
    bool target = false;
    // Thickness of a part in mm, count of septa, or share of debris, by the part's name: "halo".
    std::map<std::string, double> parts;
    std::string tissue;  // of NAME itself; empty: the kind's own
    int line = 0;        // in the recipe
};

// What was put where: an entry of the answer key, measured on the painted voxels.
struct PathologyEntry {
    std::string name;  // its label; parts such as NAME_halo are further labels
    std::string kind;
    std::string host;  // the labels that it was put into
    Point3 centre;     // `mannequin`
    double volume_ml = 0;
    Vector3 diameters_mm;  // falling; of the ellipsoid with the same moments
    double depth_mm = 0;   // of its nearest point below the skin
    std::string vessel;    // the nearest one; empty: none within vessel_mm
    double vessel_mm = 0;
    std::int64_t seed = 0;
    std::string digest;  // of its voxels
};

// [[pathology]] of a recipe, as the options of the stage.
struct PathologyOptions {
    std::vector<PathologyRequest> requests;
};

struct PathologyInput {
    const LabelVolume& cooked;           // `mannequin`, cubic voxels, direction the identity
    const BoundaryBricks& boundary;      // of cooked; may be empty
    const std::vector<Label>& palette;   // of cooked, with the tissues of this case
    const std::vector<Tissue>& tissues;  // those that the palette and the kinds name
    std::span<const PathologyRequest> requests;
    std::string where;  // names the recipe in errors: "case.toml"
    // `mannequin` from `ct`; identity if empty.
    std::function<Point3(Point3)> mannequin_from_ct;
    Point3 ct_middle{};  // of the patient, where the direction of gravity is taken
};

struct PathologyResult {
    LabelVolume volume;  // palette extended by the new labels
    BoundaryBricks boundary;
    std::vector<PathologyEntry> key;  // the answer key, in the order of the requests
    StageReport report;  // stage "pathology": the key, warnings (answer_key.h reads it back)
};

// Errors name the recipe's line: an unknown host; a host of air; a lesion larger than its host;
// clearances that leave no room, with the largest lesion that fits; a centre outside the host, or
// in an earlier lesion; more than 254 labels.
// Same bytes for any number of threads. Cost: 1 to 3 s for ten lesions in one host of 2 l at 1 mm.
Result<PathologyResult> place_pathology(const PathologyInput& input, const Progress& progress = {});

// Names of the labels that a request adds: NAME, NAME_halo, ...
std::vector<std::string> pathology_labels(const PathologyRequest& request);

// The tissues that these requests need from the table of kinds, once each.
std::vector<Tissue> pathology_tissues(std::span<const PathologyRequest> requests);

// Thickness, count or share of a part: the request's, else the kind's. 0: the part is left out.
double part_size(const PathologyRequest& request, const LesionPart& part);

}  // namespace sonocase::pipeline::inline pathology
