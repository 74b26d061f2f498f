// SPDX-License-Identifier: Apache-2.0

// The analytic torso: a patient and a mannequin known exactly, at any resolution, without any file.
//
// Skin, fat, abdominal wall, ribs, spine, liver, kidneys, spleen, stomach and bowel with gas, and
// vessels of 1.5 to 11 mm radius, each a closed-form solid in the `ct` frame (RAS+, mm, origin
// between the kidneys; about 320 mm wide, 220 deep, 320 tall). The mannequin is the patient's own
// skin under a known rigid motion and a known smooth quadratic warp. It serves as the embedded
// demonstration and as the ground truth of the accuracy figures.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "formats/volume/label_volume.h"
#include "formats/volume/surface.h"
#include "pipeline/registration/map/registration.h"

namespace sonocase::pipeline::inline anatomy {

// The torso with other proportions, such that there is more than one known truth.
struct AnalyticBody {
    double width_scale = 1;  // left to right, [0.7, 1.4]; organs scale likewise
    double depth_scale = 1;  // front to back, [0.7, 1.4]
    double belly_mm = 12;    // how far the belly protrudes, [0, 40]
    int warp = 1;            // which of the known warps makes the mannequin, 1 or 2
    bool tubes = false;      // no organs, but straight tubes of blood: a flow phantom
    int neck_seed = 0;       // not 0: the neck of this seed (neck_anatomy.h) in the torso's place
};

// The bodies that a recipe can name: "standard"; "slender", which is narrower and shallower and
// whose mannequin is made by the second warp; and "flow-phantom", skin and one even material with
// straight tubes of 4, 6, 8 and 12 mm and one of 10 mm with a stenosis of 6 mm, 50 degrees from a
// beam straight down; "neck", the neck by rule of seed 1, without scaling. Empty for any other
// name.
std::optional<AnalyticBody> analytic_body(std::string_view name);
std::vector<std::string> analytic_body_names();

// Palette, outside first. Names are those of TotalSegmentator's classes where it has the structure.
std::vector<Label> analytic_torso_labels(const AnalyticBody& body = {});

// Palette index at a point. Cost: about 100 ns.
std::uint8_t analytic_torso_label(Point3 ct, const AnalyticBody& body = {});

// Distance from a point to the surface of the region with palette index `label`, negative inside.
// The sign is exact. The value is exact to 1e-6 mm where the nearest surface point is on a smooth
// face within `reach_mm`, and a lower bound near edges where two solids meet. Standard body only.
// Cost: a millisecond in the liver, a tenth of that with a reach of 3 mm.
double analytic_torso_signed_distance(int label, Point3 ct, double reach_mm = 30);

// Labels at the voxel centres. Same bytes for any number of threads.
LabelVolume sample_analytic_torso(const Grid& grid, const AnalyticBody& body = {});
// Grid over the whole patient, who is cut at the top and bottom as in any abdominal CT.
Grid analytic_torso_grid(Vector3 spacing_mm, const AnalyticBody& body = {});

// The map that made the mannequin: rigid and quadratic parts, no residual. The quadratic part moves
// the skin by 9 mm on average; the smallest det J over the patient's box is above 0.6. `strength`
// scales the quadratic part; 0: the rigid motion alone.
Registration analytic_torso_truth(double strength = 1, const AnalyticBody& body = {});

struct AnalyticMannequinOptions {
    int points = 2000;        // readings, or vertices of the mesh (approximately)
    double noise_mm = 0.7;    // standard deviation per axis; 0 for a mesh
    bool mesh = false;        // triangles, open at the cuts at the top and bottom
    bool front_only = false;  // readings only from the front and the flanks
    double strength = 1;      // of the quadratic warp
    std::uint64_t seed = 1;
};
// The patient's skin on the mannequin, in the `mannequin` frame; extends 30 mm beyond the patient's
// grid at either end. Readings are in random order and have no normals.
Surface analytic_torso_mannequin(const AnalyticMannequinOptions& options = {},
                                 const AnalyticBody& body = {});

// Landmarks of the skin on both bodies: navel, tip of the breastbone, costal margins, hip bones,
// pubis, ribs, loins, spinous processes. At most fourteen, of a neck none; noise_mm per axis is the
// error of pointing, on the mannequin only.
struct AnalyticLandmark {
    std::string name;
    Point3 ct, mannequin;
};
std::vector<AnalyticLandmark> analytic_torso_landmarks(int count,
                                                       double noise_mm,
                                                       const AnalyticMannequinOptions& options = {},
                                                       const AnalyticBody& body = {});

}  // namespace sonocase::pipeline::inline anatomy
