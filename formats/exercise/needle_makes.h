// SPDX-License-Identifier: Apache-2.0

// The makes of needle: how each shows, by the angle between shaft and beam and by the side that its
// bevel faces.
//
// Measured figures: van de Berg et al., Ultrasound Med Biol 2018,
// doi 10.1016/j.ultrasmedbio.2018.10.004; medians of ten recordings in a tissue phantom. The
// amplitudes are fitted to them: tests/runtime/imaging/needle_makes_test.cpp measures frames as the
// source measured pictures, in tissue and in water.
//
// Echo, as a share of what a mirror of steel sends back at a right angle to the beam, at an angle a
// off it and `from_tip` mm back along the shaft:
//
//     base + (1 - base) 2^-(sin a / lobe_sin)^2
//     base = rough + (tip - rough) g,          g = clamp(2 - from_tip / 1 mm, 0, 1)
//     tip  = tip_away + (tip_towards - tip_away) (1 + f) / 2
//
// f is the cosine of the bevel's roll: 1 where it faces the probe, -1 where it faces away.
#pragma once

#include <algorithm>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace sonocase {

struct NeedleMake {
    const char* name;    // `make` in the table [needle] of an exercise
    const char* about;   // shown to the trainee
    double diameter_mm;  // where the exercise gives neither gauge nor diameter
    double rough;        // off the mirror; notches send an echo back at every angle
    double lobe_sin;
    double tip_towards, tip_away;
    bool echogenic;  // bright at every angle: the window says so

    // Contrast to noise as measured: full width of the mirror's lobe at half of its step (0: flat);
    // median 30 to 55 degrees off the mirror, and of the tip, as shares of the lobe's peak.
    double measured_width_deg, measured_floor, measured_tip_towards, measured_tip_away;
};

std::span<const NeedleMake> needle_makes();  // the first is the default
std::vector<std::string> needle_make_names();
const NeedleMake* find_needle_make(std::string_view name);  // null: none of that name

// g above.
inline double needle_tip_part(double from_tip_mm) {
    return std::clamp(2 - from_tip_mm, 0.0, 1.0);
}

}  // namespace sonocase
