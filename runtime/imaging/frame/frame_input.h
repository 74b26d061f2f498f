// SPDX-License-Identifier: Apache-2.0

// What goes into a frame and what is said about it afterwards.
#pragma once

#include <array>
#include <cstdint>

#include "formats/base/geometry.h"
#include "runtime/imaging/frame/doppler_settings.h"

namespace sonocase::runtime {

// The controls of the machine's console; may change between frames. A value that is not finite
// counts as neutral.
struct ImageSettings {
    double gain_db = 0;
    double dynamic_range_db = 60;    // clamped to [20, 120]
    std::array<double, 8> tgc_db{};  // sliders, near to far
    bool flip_left_right = false;
    // By which the probe presses deeper than its pose says, [0, 40] mm: on a rigid mannequin
    // nobody can press. Without effect deformation it does nothing.
    double press_mm = 0;
    DopplerSettings doppler;

    friend bool operator==(const ImageSettings&, const ImageSettings&) = default;
};

// A straight needle as drawn: after calibration and bend constraint.
struct NeedlePose {
    Point3 tip;         // `mannequin` frame
    Vector3 direction;  // unit, hub to tip
    // By which it pushes the layer before its tip, and drags tissue along its shaft
    // (runtime/needle/needle_shift.h). Drawn with effect deformation.
    double tent_mm = 0, drag_mm = 0;
};

struct FrameInput {
    Rigid mannequin_from_probe;
    bool has_needle = false;
    NeedlePose needle;
    double time_s = 0;        // injected; drives breathing and pulsation
    std::uint32_t frame = 0;  // seeds the noise
    ImageSettings settings;
    // Motion of the probe since the frame before, frame `mannequin`: of the middle of its face, and
    // its rotation. Only Doppler modes ask for it; what moves in the picture flashes in them.
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
    // Area of the draining lumens under the face, in the scan plane and less what a picture shows
    // shut (walls that touch), over that at rest; negative: there are none, or
    // nothing is pressed.
    double vein_open = -1;
    bool pressed = false;       // else all is 0
    double force_n = 0;         // on the whole face
    double pressure_kpa = 0;    // over the part of it that touches
    double deepest_mm = 0;      // greatest depth below the resting skin
    double excess_mm = 0;       // by how much bone holds the face back from the pose
    bool out_of_reach = false;  // more than 30 mm inside the body: drawn as if 30
};

// What one effect cost in the last frame.
struct EffectCost {
    const char* name = "";
    double ms = 0;
    bool ran = false;
    const char* skipped_because = "";  // "" where it ran
};

}  // namespace sonocase::runtime
