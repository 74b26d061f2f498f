// SPDX-License-Identifier: Apache-2.0

// An exercise: probe, needle, targets, motion of the anatomy, effects and pass marks. Read from
// TOML (scenarios/<name>/<exercise>.toml). The error for an unknown key names the file, the line
// and the nearest valid key.
#pragma once

#include <cmath>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "formats/base/geometry.h"
#include "formats/base/result.h"
#include "formats/exercise/needle_makes.h"
#include "formats/exercise/procedure.h"

namespace sonocase {

enum class ProbeShape { linear, curvilinear, phased };
const char* probe_shape_name(ProbeShape shape);  // as files have it

// Probe frame: origin at the middle of the probe face, x along the face towards the orientation
// mark (lateral), y across it (elevation), z into the body (depth).
struct Probe {
    ProbeShape shape = ProbeShape::curvilinear;
    double radius_mm = 60;           // curvilinear: of the face; phased: ignored
    double field_of_view_rad = 1.2;  // curvilinear and phased: full opening angle
    double width_mm = 50;            // linear: of the face; phased: of the array
    double depth_mm = 150;           // > 0
    double frequency_mhz = 3.5;
    double focus_mm = 70;
    double elevation_mm = 3;  // full beam thickness at the focus
};

// A probe's numbers as files name them, with their limits.
struct ProbeNumber {
    const char* name;
    double Probe::*value;
    double min, max;
};
std::span<const ProbeNumber> probe_numbers();

// From the middle of the picture to the end of the face, where the orientation mark stands: beside
// the end that x points to.
double half_face_mm(const Probe& probe);

inline constexpr double kMinGauge = 6, kMaxGauge = 34;  // the smaller, the thicker
inline constexpr double kMaxNeedleDiameterMm = 10, kMaxNeedleLengthMm = 1000;

struct NeedleModel {
    const NeedleMake* make = &needle_makes().front();  // how it shows; never null
    double gauge = 18;                                 // used for the diameter if diameter_mm is 0
    double diameter_mm = 0;
    double length_mm = 150;
    double slab_mm = 0;           // thickness t of the scan plane for the needle; 0: its diameter
    double tip_visibility = 1;    // model paper: opacity at the tip, [0, 1]
    double shaft_visibility = 1;  // model paper: opacity far from the tip, [0, 1]
    // Bend constraint, eqs. (16)-(17).
    double bend_max_weight = 1;
    double bend_alpha_per_m = 60;
    double bend_delta_m = 0.12;
};

enum class TargetLook { none, marker, lesion, cyst, abscess, calyx };

// The axes of a drawn lesion: an ellipsoid of the same volume as the ball of its radius.
struct LesionAxes {
    Matrix3 axes;              // columns: unit, at right angles
    Vector3 lengths{1, 1, 1};  // half of each axis, radii of the ball; their product is 1
};

struct Target {
    std::string name;
    Point3 centre;             // `mannequin` frame
    double radius_mm = 5;      // of the target itself
    double hit_radius_mm = 5;  // a tip this near the centre is a hit
    TargetLook look = TargetLook::marker;
    // For a lesion: the kind of formats/pathology that says how it shows; empty: a plain lesion.
    std::string kind;
    LesionAxes axes;     // drawn for each attempt by its kind; a ball in the exercise as written
    std::string inside;  // label that it must lie in; empty: anywhere
    // An attempt may draw the target anywhere in this ball about `centre`, with nothing but
    // `inside` within clearance_mm (formats/scoring/draw_attempt.h). 0: the target stays at its
    // centre.
    double spread_mm = 0;
    double clearance_mm = -1;  // negative: the target's radius
};

// A finding that is not a target: the trainee has to tell it from one.
struct Finding {
    Target lesion;             // hit_radius_mm is not used
    double radius_spread = 0;  // an attempt draws the radius from (1 -+ this) times radius_mm
    double chance = 1;         // that an attempt has it, (0, 1]
};

// One pose of a scripted path, to be reached at a given time; positions and directions are
// interpolated smoothly between key poses.
struct SweepKey {
    double time_s = 0;
    Point3 probe;              // probe face middle, `mannequin` frame
    Vector3 beam{0, 0, -1};    // probe z
    Vector3 lateral{1, 0, 0};  // probe x, made orthogonal to beam
    bool has_needle = false;
    Point3 needle_tip;
    Vector3 needle_direction{0, 0, -1};  // hub to tip
    ActList acts;                        // performed as this time is reached
};

struct Sweep {
    std::string name;
    bool snap_to_skin = false;   // move the probe along its beam to the skin
    std::vector<SweepKey> keys;  // times rising
};

struct BreathingMotion {
    double amplitude_mm = 0;  // 0: none
    double period_s = 4;
    Vector3 direction{0, -1, 0};  // of inspiration, `mannequin` frame
};

struct Pulsation {
    double amplitude_mm = 0;
    double rate_per_min = 70;
};

// Practice shows the targets once all hints have been asked for; an exam shows neither hints nor
// targets nor the distance that is left.
enum class ExerciseMode { practice, exam };

// How tissue yields to the probe (effect deformation; docs/deformation.md).
struct Deformation {
    double venous_pressure_mmhg = 8;  // veins are as stiff as this pressure makes them
    double stiffness_scale = 1;       // of every tissue
    double press_offset_mm = 0;       // how far the probe is pressed in at the start
    double force_limit_n = 15;        // for the score of the time above it
    // Walls of veins with the table level and quiet breath, beyond those of the case; and how much
    // farther out the highest pressure drives them (vein_state() in motion.h). At most two voxels.
    double vein_level_mm = 0, vein_swell_mm = 0;
};

// Free fluid in a space of the abdomen, where it lies lowest. It takes the place of one tissue,
// that between the organs, within an ellipsoid and below a level that volume and posture give
// (formats/scoring/free_fluid.h). Organs and bowel stay where they are.
struct FreeFluid {
    std::string name = "free_fluid";  // in conditions and questions
    double ml = 0;                    // 0: none
    double ml_spread = 0;             // an attempt draws the volume from (1 -+ this) times ml
    double chance = 1;                // that an attempt has it, (0, 1]
    bool blood = false;               // fresh blood, with echoes; otherwise clear
    std::string lies_in;              // label
    Point3 centre;                    // `mannequin` frame
    Vector3 half_mm;                  // of the ellipsoid: across, front to back, head to foot
    // Of the patient on the back, with the table level: away from the ground, and to the head.
    Vector3 up{0, 1, 0}, head{0, 0, 1};
};

struct Exercise {
    std::string name;
    std::string title;  // shown to the trainee
    std::string description;
    std::string kind = "biopsy";  // biopsy | drainage | nephrostomy | vascular | scan
    int difficulty = 1;           // 1 easy .. 5 hard
    ExerciseMode mode = ExerciseMode::practice;
    std::vector<std::string> hints;            // in the order in which a trainee gets them
    int mastery = 3;                           // passes in a row that count as mastered
    std::string model = "physical";            // physical | paper
    std::vector<std::string> effects{"auto"};  // "auto", "all", or names of the effects table
    Probe probe;
    NeedleModel needle;
    std::vector<Target> targets;
    std::vector<Finding> findings;
    std::vector<std::string> no_go;  // labels that must not be touched
    Point3 start_probe;              // where the mouse tracker begins
    Vector3 start_beam{0, 0, -1};
    Vector3 start_lateral{1, 0, 0};  // probe x, made orthogonal to start_beam
    double start_spread_mm = 0;      // an attempt begins half to all of this away from start_probe
    std::vector<Sweep> sweeps;
    BreathingMotion breathing;
    Pulsation pulsation;
    Deformation deformation;
    std::vector<FreeFluid> free_fluids;  // at most SceneChange::kMaxFluids
    // Pass marks: metric name and limits, both inclusive; see docs/metrics.md.
    struct PassMark {
        std::string metric;
        double at_most = INFINITY;
        double at_least = -INFINITY;
    };
    std::vector<PassMark> pass_marks;
    Procedure procedure;  // steps and checklist; empty: the exercise has none
};

// `where` names the file in errors.
Result<Exercise> parse_exercise(std::string_view toml, const std::string& where);

// mannequin_from_probe where the exercise begins, before the probe is set down on the skin.
Rigid start_pose(const Exercise& exercise);

// The lesions that show in the tissue: findings, then targets.
std::vector<Target> shown_lesions(const Exercise& exercise);

// Its kind of formats/pathology, or what its look says: "marker", "cyst", ...
std::string lesion_kind_name(const Target& lesion);

// Radius of the ball or ellipsoid that a picture shows of a lesion, with those shells of its kind
// that have a thickness of their own: one thinner than kThinShellMm is only an echo of the surface.
double shown_radius_mm(const Target& lesion);
inline constexpr double kThinShellMm = 0.75;

// How far a lesion reaches from its centre, with the shells of its kind.
double outer_radius_mm(const Target& lesion);

// Axes of the ellipsoid of free fluid: across to the right, to the front, to the head.
Matrix3 free_fluid_axes(const FreeFluid& fluid);

double needle_diameter_mm(const NeedleModel& needle);  // as given, or by the gauge

}  // namespace sonocase
