// SPDX-License-Identifier: Apache-2.0

// How an ultrasound machine draws: its beam, speckle, grey map, gain and artefacts, as data.
// parse_machine() reads it from the table [machine] of a TOML file; `sonocase look` measures one.
//
// The defaults are those of the built-in machine `modern`, fitted to a tracked sweep of a living
// liver (fan; docs/realism.md). The limits in brackets are those of the reader. Amplitudes are
// relative to e = 1: the mean amplitude of healthy liver after time gain compensation. Depths are
// along the beam, from the probe's face.
#pragma once

#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "formats/base/result.h"

namespace sonocase {

// Widths are full widths at half height of the point spread's amplitude (two-way). A width given
// here holds at reference_mhz and is scaled by reference_mhz / frequency.
struct MachineBeam {
    double frequency_mhz = 0;    // 0: the exercise's; otherwise [0.5, 50]
    double reference_mhz = 3.5;  // [0.5, 50]
    double axial_mm = 0.75;      // along the beam; 0: from the frequency alone; [0, 10]
    // Along the face: width = lateral_mm sqrt(1 + ((r - focus) / range)^2). A dynamic receive focus
    // keeps the beam narrow near the face, so that the focus lies there.
    double lateral_mm = 0.85;      // at the focus; 0: from the frequency; [0, 20]
    double lateral_focus_mm = 1;   // 0: the exercise's; [0, 500]
    double lateral_range_mm = 65;  // [1, 1e4]
    // Skirt of the point spread along the face, as the body wall's aberration leaves it: a second
    // Gaussian, skirt_width times as wide. skirt: root of its power over that of the first.
    double skirt = 0.5;       // 0: none; [0, 4]
    double skirt_width = 3;   // [1, 10]
    double elevation_mm = 0;  // slice thickness at the focus; 0: the exercise's; [0, 50]
    // Width of the receiving face. Whatever blocks a part of it casts a shadow whose edges soften
    // with depth. 0: the edges stay sharp; [0, 100].
    double aperture_mm = 17;
    int lines = 176;  // beams of a frame, [16, 1024]
    bool operator==(const MachineBeam&) const = default;
};

// Independent speckle fields that are detected and averaged: spatial and frequency compounding.
struct MachineLooks {
    int count = 2;        // [1, 16]
    int near_count = 4;   // at depths up to near_mm, [1, 16]
    double near_mm = 30;  // [0, 500]
    bool operator==(const MachineLooks&) const = default;
};

// power: grey = floor + level e^exponent; above the grey `knee` the slope is multiplied by
// knee_slope. log:   grey = level + 255 / dynamic_range_db * 20 log10(e), not below floor.
enum class GreyMap { power, log };
struct MachineGrey {
    GreyMap map = GreyMap::power;
    double floor = 9;              // the machine's own black, [0, 255]
    double level = 56;             // of e = 1; power: above the floor; [1, 255]
    double exponent = 0.75;        // power only, [0.05, 4]
    double knee = 160;             // power only; 255: none; [1, 255]
    double knee_slope = 0.5;       // [0, 1]
    double dynamic_range_db = 60;  // log; for both maps, where the console's knob starts; [20, 120]
    bool operator==(const MachineGrey&) const = default;
};

struct MachineNoise {
    double level_db = -70;  // of the receiver, amplitude relative to e = 1, [-200, 20]
    bool reject = true;     // nothing below the grey floor is drawn, not even noise
    // Standard deviation of each sample's own gain, dB: a grain finer than the point spread, which
    // grows with the echo and stays in its place in the picture. 0: none; [0, 3].
    double grain_db = 0;
    bool operator==(const MachineNoise&) const = default;
};

struct MachineGain {
    double tgc_db_per_cm_mhz = 0;  // one way; 0: by the probe's shape; [0, 3]
    double far_from_mm = 100;      // beyond it the gain falls again, [0, 500]
    double far_db_per_cm = 0.8;    // rate of that fall, [0, 30]
    double far_limit_db = 11;      // limit of that fall, [0, 120]
    bool operator==(const MachineGain&) const = default;
};

// Ringing of the probe's face: amplitude ring_level exp(-r / ring_decay_mm), with a second, slower
// decay, and lines fixed to the probe at first_mm + k spacing_mm, line_db - k line_step_db over it.
// Everything else is multiplied by min(1, start + r / start_mm) below the face.
struct MachineNearField {
    double ring_level = 1.1;     // [0, 100]
    double ring_decay_mm = 2.5;  // [0.1, 100]
    double tail_level = 0;       // [0, 100]
    double tail_decay_mm = 9;    // [0.1, 100]
    int lines = 6;               // [0, 32]
    double first_mm = 0.5;       // [0, 50]
    double spacing_mm = 1.9;     // [0.1, 50]
    double line_db = 7;          // [-60, 60]
    double line_step_db = 2.2;   // [0, 60]
    double line_mm = 0.8;        // full width at half height, [0.05, 20]
    double start = 0.25;         // [0, 1]; 1: not darker at the face
    double start_mm = 3;         // [0.1, 50]
    bool operator==(const MachineNearField&) const = default;
};

// Haze under bright lines: along each beam, power fraction (1 - q) sum q^k s^2 with
// q = exp(-dr / decay_mm), smoothed over across_mm along the face.
struct MachineHaze {
    double fraction = 0.2;  // 0: none; [0, 10]
    double decay_mm = 4.5;  // [0.1, 100]
    double across_mm = 2;   // full width of the mean, [0, 50]
    // Side lobes: level of a share of the neighbourhood's mean envelope, dB; -120: none; [-120, 0]
    double side_lobe_db = -120;
    bool operator==(const MachineHaze&) const = default;
};

// Poor contact of the outer beams: edge_db at the outermost, over edge_fraction of the face.
struct MachineContact {
    double edge_db = 10;         // [0, 120]
    double edge_fraction = 0.1;  // of the face, at each end, [0, 0.5]
    bool operator==(const MachineContact&) const = default;
};

// Equalisation of the gain across the beams: a beam that differs from its neighbours over some
// millimetres is brought half the way to them.
struct MachineEqualisation {
    double amount = 1;    // [0, 1]; 0: none
    double from_mm = 35;  // deeper than this, [0, 500]
    bool operator==(const MachineEqualisation&) const = default;
};

// Adaptive speckle reduction leaves little detail in even tissue and much where it finds structure.
// The contrast about the local mean therefore varies between places some millimetres large.
struct MachineSpeckleReduction {
    double variation = 0.3;  // standard deviation of the contrast, whose mean is 1; 0: none; [0, 1]
    double from_mm = 20;     // deeper than this, [0, 500]
    bool operator==(const MachineSpeckleReduction&) const = default;
};

// Structures that a case does not hold and the renderer adds to its tissue, each an effect
// (docs/effects.md); linings are the walls of vessels and the double line of capsules. A machine of
// the nineties shows none of them, and its frames do not take the time for them.
struct MachineStructures {
    bool parenchyma = true, streaks = true, diaphragm = true, wall = true, linings = true;
    bool operator==(const MachineStructures&) const = default;
};

struct Machine {
    std::string name = "modern";
    std::string title = "Modern scanner, abdominal fan";  // shown to people
    MachineBeam beam;
    MachineLooks looks;
    MachineGrey grey;
    MachineNoise noise;
    MachineGain gain;
    MachineNearField near_field;
    MachineHaze haze;
    MachineContact contact;
    MachineEqualisation equalisation;
    MachineSpeckleReduction speckle_reduction;
    MachineStructures structures;
    // Weights of the frames that persistence blends, newest first; scaled to a sum of 1. A single
    // weight: no persistence.
    std::vector<double> persistence{0.4, 0.3, 0.2, 0.1};  // 1 to 8 weights, [0, 1], the first > 0
    double edge_enhancement = 0;  // amount of the unsharp mask; 0: none; [0, 4]
    bool post_filter = false;     // speckle reduction: a binomial filter of three samples
    // Measured levels of tissues, dB over e = 1, by label. Optional.
    std::map<std::string, double> tissue_db;  // [-60, 60]
    bool operator==(const Machine&) const = default;
};

// Reads a machine from text:
//
//     [machine]
//     base = "modern"          # keys that are left out come from it; the default is modern
//     name = "clinic"
//     [machine.grey]
//     level = 52
//
// `where` names the file in errors, which give the line, the key and its limits, and for an unknown
// key the nearest valid one. A number that is NaN or infinite is out of range.
Result<Machine> parse_machine(std::string_view toml, const std::string& where);

// Writes every key: parse_machine(machine_toml(m)) equals m to the last bit. `m` must lie within
// the limits above.
std::string machine_toml(const Machine& machine);

std::vector<std::string> machine_names();  // classic, modern, modern-linear
// Errors: an unknown name, with the nearest valid one.
Result<Machine> built_in_machine(std::string_view name);

}  // namespace sonocase
