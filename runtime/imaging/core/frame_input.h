// SPDX-License-Identifier: Apache-2.0

// What goes into a frame, and what is reported about it afterwards.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>

#include "formats/base/geometry.h"
#include "formats/exercise/procedure.h"

namespace sonocase::runtime {

// Returns the value of a control, brought into its range, or `otherwise` if it is not finite.
inline double setting_within(double value, double low, double high, double otherwise) {
    return std::isfinite(value) ? std::clamp(value, low, high) : otherwise;
}

enum class DopplerMode : std::uint8_t { off, colour, power, spectral, m_mode };

// The console's controls of colour, power and spectral Doppler and of M-mode; may change between
// frames. Velocities are positive towards the probe. A value that is out of range or not finite is
// replaced by the nearest one that makes sense.
struct DopplerSettings {
    DopplerMode mode = DopplerMode::off;

    // Colour box: part of the probe's face, [0, 1] from its left end, and depths. A linear probe
    // steers it.
    double box_left = 0.25, box_right = 0.75;
    double box_top_mm = 15, box_bottom_mm = 45;
    double steer_deg = 0;  // colour and spectral beams of linear probes, [-30, 30]

    double scale_cm_s = 30;            // Nyquist limit, [1, 500]: velocities beyond it wrap around
    double spectral_scale_cm_s = 100;  // Nyquist limit of the spectrum
    double baseline = 0;               // shift of zero, part of the scale, [-0.9, 0.9]
    bool invert = false;
    double wall_filter = 0.1;  // cut-off, part of the scale, [0, 0.5]
    double gain_db = 0;        // [-30, 30]
    double priority = 0.5;     // grey above this part of white stays grey, [0, 1]
    int ensemble = 10;         // pulses per line, [4, 16]
    int persistence = 2;       // frames, [1, 4]

    // Spectral gate and M-mode line: part of the face, and the gate's middle and length.
    double gate_line = 0.5;
    double gate_depth_mm = 30;
    double gate_mm = 3;  // [0.5, 30]
    // Angle that the angle cursor shows, [-80, 80]; velocities are divided by its cosine.
    double angle_deg = 60;
    double diameter_mm = 0;  // as measured in the picture, for volume flow; 0: not measured
    int gate_points = 64;    // [8, 1024]: see docs/flow.md for what they cost

    friend bool operator==(const DopplerSettings&, const DopplerSettings&) = default;
};

// The controls of the machine's console; may change between frames. A value that is not finite
// counts as neutral.
struct ImageSettings {
    double gain_db = 0;
    double dynamic_range_db = 60;    // clamped to [20, 120]
    std::array<double, 8> tgc_db{};  // sliders, near to far
    bool flip_left_right = false;
    // How much deeper the probe presses than its pose says, [0, 40] mm: on a rigid mannequin nobody
    // can press. It does nothing without effect deformation.
    double press_mm = 0;
    DopplerSettings doppler;

    friend bool operator==(const ImageSettings&, const ImageSettings&) = default;
};

// How a picture answers to gain. Power: what a grey has above `black` grows by a factor of
// 10^(exponent dB / 20). Exponent 0, logarithm: grey grows by 255 dB over the dynamic range.
struct GainLaw {
    double black = 0, exponent = 1;
    // Range at which the exponent holds; at another one it is smaller in the same proportion as
    // that is wider. 0: the console's range does nothing.
    double range_db = 0;
    double knee = 255, knee_slope = 1;  // of a power: above `knee`, grey grows by so much of that
};

// A straight needle as drawn: after calibration and bend constraint.
struct NeedlePose {
    Point3 tip;         // `mannequin` frame
    Vector3 direction;  // unit, hub to tip
    // How far it pushes the layer before its tip and drags tissue along its shaft
    // (runtime/imaging/core/needle_shift.h). Effect deformation draws both.
    double tent_mm = 0, drag_mm = 0;
    // Unit, at right angles to the shaft: the side that the bevel faces. Zero: towards the probe.
    Vector3 bevel = {};
};

struct FrameInput {
    Rigid mannequin_from_probe;
    bool has_needle = false;
    NeedlePose needle;
    double time_s = 0;        // injected; drives breathing and pulsation
    std::uint32_t frame = 0;  // seeds the noise
    ImageSettings settings;
    SceneChange change;  // what acts of a procedure have changed in the tissue
    // Velocity of the middle of the probe's face since the frame before, and its rotation, frame
    // `mannequin`. Only Doppler modes use them: what moves in the picture flashes in colour.
    Vector3 probe_mm_s, probe_rad_s;
};

enum class FrameStatus : std::uint8_t {
    rendered,
    held_bad_pose,  // not finite, mirrored or not orthonormal: the pixels are left as they were
    no_contact,     // rendered, and the probe does not touch the skin
};

// What the probe does to the tissue under it (effect deformation).
struct PressReport {
    bool solved = false;  // the effect is on
    // Area of the draining lumens under the face, in the scan plane and without the parts that a
    // picture shows collapsed (walls that touch), over that at rest; negative: there are none, or
    // nothing is pressed.
    double vein_open = -1;
    bool pressed = false;       // if not, all that follows is 0
    double force_n = 0;         // on the whole face
    double pressure_kpa = 0;    // over the part of it that touches
    double deepest_mm = 0;      // greatest depth below the resting skin
    double excess_mm = 0;       // how far bone holds the face back from the pose
    bool out_of_reach = false;  // more than 30 mm inside the body: drawn as if 30
};

// What one effect cost in the last frame.
struct EffectCost {
    const char* name = "";
    double ms = 0;  // its estimated share of its pass
    bool ran = false;
    const char* why = "";          // what calls for it in this frame, or why it did not run
    bool can_be_left_out = false;  // the model draws pictures without it
};

// What a Doppler mode showed in a frame, beside what was true there: for recordings and scores.
// Labels are palette indices of the bundle; -1: none.
struct DopplerReport {
    bool on = false;  // mode colour, power or spectral

    // Colour and power: the vessels with the most cells in colour, each with at least
    // kColouredCells and at least kColouredPart of its cells in the box.
    static constexpr int kColouredCells = 12;
    static constexpr double kColouredPart = 0.4;
    std::array<int, 4> coloured{-1, -1, -1, -1};

    // Spectral: the vessel that most of the gate lies in.
    int gate_label = -1;
    double gate_fill = 0;      // share of the gate that lies in its blood
    double angle_deg = 0;      // between beam and flow there, [0, 90]
    double cursor_deg = 0;     // angle that the angle cursor shows, [0, 80]
    int beats = 0;             // number of beats measured since a setting changed
    double psv_cm_s = 0;       // peak systolic velocity as measured, by the cursor
    double true_psv_cm_s = 0;  // fastest blood of that vessel there, in the same beats
};

}  // namespace sonocase::runtime
