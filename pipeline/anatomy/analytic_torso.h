// SPDX-License-Identifier: Apache-2.0

// The analytic torso: a patient and a mannequin known exactly, at any resolution, from no file.
//
// Skin, fat, abdominal wall, ribs, spine, liver, kidneys, spleen, stomach and bowel with gas, and
// vessels of 11 to 1.5 mm radius, each a closed-form solid in the `ct` frame (RAS+, mm, origin
// between the kidneys; about 320 mm wide, 220 deep, 320 tall). The mannequin is the patient's own
// skin under a known rigid motion and a known smooth quadratic warp. It is the embedded
// demonstration and the ground truth of the accuracy figures.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "formats/registration/registration.h"
#include "formats/volume/label_volume.h"
#include "formats/volume/surface.h"

namespace sonocase::pipeline {

// A body is the torso with its proportions changed, so that there is more than one known truth.
struct AnalyticBody {
    double width_scale = 1;  // of the patient across, [0.7, 1.4]; organs move along
    double depth_scale = 1;  // front to back, [0.7, 1.4]
    double belly_mm = 12;    // how far the belly stands out, [0, 40]
    int warp = 1;            // which known warp makes the mannequin, 1 or 2
};

// The bodies that a recipe can name: "standard", and "slender": narrower and shallower, its
// mannequin made by the second warp. Empty for another name.
std::optional<AnalyticBody> analytic_body(std::string_view name);
std::vector<std::string> analytic_body_names();

// Palette, outside first. Names are those of TotalSegmentator's classes where it has one.
std::vector<Label> analytic_torso_labels();

// Palette index at a point. Cost: about 100 ns.
std::uint8_t analytic_torso_label(Point3 ct, const AnalyticBody& body = {});

// Distance from a point to the surface of the region with palette index `label`, negative inside.
// Sign exact; value exact to 1e-6 mm where the nearest surface point is on a smooth face within
// `reach_mm`, and a lower bound near edges where two solids meet. For unscaled bodies only. Cost: a
// millisecond in the liver, a tenth of that with a reach of 3 mm.
double analytic_torso_signed_distance(int label, Point3 ct, double reach_mm = 30);

// Samples voxel centres. Same bytes for any number of threads.
LabelVolume sample_analytic_torso(const Grid& grid, const AnalyticBody& body = {});
// Grid over the whole patient: the body is cut at its top and bottom as in any abdominal CT.
Grid analytic_torso_grid(Vector3 spacing_mm);

// The map that made the mannequin: rigid and quadratic parts, no residual. The quadratic moves skin
// by 9 mm on average beyond the rigid part; its smallest det J over the patient's box is above 0.6.
// `strength` scales the quadratic part; 0 leaves the rigid motion.
Registration analytic_torso_truth(double strength = 1, const AnalyticBody& body = {});

struct AnalyticMannequinOptions {
    int points = 2000;        // readings, or vertices of the mesh (approximately)
    double noise_mm = 0.7;    // standard deviation per axis; 0 for a mesh
    bool mesh = false;        // triangles, open at the neck and hip cuts
    bool front_only = false;  // readings from the front and flanks alone
    double strength = 1;      // of the quadratic warp
    std::uint64_t seed = 1;
};
// The patient's skin as the mannequin carries it, in the `mannequin` frame; reaches 30 mm beyond
// the patient's grid at either end. Readings are shuffled and carry no normals.
Surface analytic_torso_mannequin(const AnalyticMannequinOptions& options = {},
                                 const AnalyticBody& body = {});

// Places of the skin that carry a marker on both bodies: navel, tip of the breastbone, costal
// margins, hip bones, pubis, ribs, loins, spinous processes. At most fourteen; noise_mm per axis is
// the error of pointing, added on the mannequin's side.
struct AnalyticLandmark {
    std::string name;
    Point3 ct, mannequin;
};
std::vector<AnalyticLandmark> analytic_torso_landmarks(int count,
                                                       double noise_mm,
                                                       const AnalyticMannequinOptions& options = {},
                                                       const AnalyticBody& body = {});

}  // namespace sonocase::pipeline
