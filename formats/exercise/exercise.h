// SPDX-License-Identifier: Apache-2.0

// An exercise: probe, needle, targets, motion of the anatomy, effects and pass marks. Read from
// TOML (scenarios/<name>/<exercise>.toml). The error for an unknown key names the file, the line
// and the nearest valid key.
#pragma once

#include <cmath>
#include <string>
#include <string_view>
#include <vector>

#include "formats/base/geometry.h"
#include "formats/base/result.h"

namespace sonocase {

enum class ProbeShape { linear, curvilinear, phased };

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

struct NeedleModel {
    double gauge = 18;  // used for the diameter if diameter_mm is 0
    double diameter_mm = 0;
    double length_mm = 150;
    double slab_mm = 0;           // thickness t of the scan plane for the needle; 0: its diameter
    double tip_visibility = 1;    // model paper: opacity at the tip, [0, 1]
    double shaft_visibility = 1;  // and far from it, [0, 1]
    // Bend constraint, eqs. (16)-(17).
    double bend_max_weight = 1;
    double bend_alpha_per_m = 60;
    double bend_delta_m = 0.12;
};

enum class TargetLook { none, marker, lesion, cyst, abscess, calyx };

struct Target {
    std::string name;
    Point3 centre;             // `mannequin` frame
    double radius_mm = 5;      // of the target itself
    double hit_radius_mm = 5;  // a tip this near the centre is a hit
    TargetLook look = TargetLook::marker;
    std::string inside;  // label that it must lie in; empty: anywhere
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

// How tissue yields to the probe (effect deformation; docs/deformation.md).
struct Deformation {
    double venous_pressure_mmhg = 8;  // veins are as stiff as this pressure makes them
    double stiffness_scale = 1;       // of every tissue
    double press_offset_mm = 0;       // by which the probe begins pressed in; the player changes it
    double force_limit_n = 15;        // for the score of the time above it
};

struct Exercise {
    std::string name;
    std::string title;  // shown to the trainee
    std::string description;
    std::string kind = "biopsy";               // biopsy | drainage | nephrostomy | vascular | scan
    int difficulty = 1;                        // 1 easy .. 5 hard
    std::string model = "physical";            // physical | paper
    std::vector<std::string> effects{"auto"};  // "auto", "all", or names of the effects table
    Probe probe;
    NeedleModel needle;
    std::vector<Target> targets;
    std::vector<std::string> no_go;  // labels that must not be touched
    Point3 start_probe;              // where the mouse tracker begins
    Vector3 start_beam{0, 0, -1};
    std::vector<Sweep> sweeps;
    BreathingMotion breathing;
    Pulsation pulsation;
    Deformation deformation;
    // Pass marks: metric name and limits, both inclusive; see docs/metrics.md.
    struct PassMark {
        std::string metric;
        double at_most = INFINITY;
        double at_least = -INFINITY;
    };
    std::vector<PassMark> pass_marks;
};

// `where` names the file in errors.
Result<Exercise> parse_exercise(std::string_view toml, const std::string& where);

double needle_diameter_mm(const NeedleModel& needle);  // from the gauge table where not given

}  // namespace sonocase
