// SPDX-License-Identifier: Apache-2.0

// The console's controls of colour, power and spectral Doppler and of M-mode; may change between
// frames. Velocities are positive towards the probe.
#pragma once

#include <cstdint>

namespace sonocase::runtime {

enum class DopplerMode : std::uint8_t { off, colour, power, spectral, m_mode };

// Where values are out of range or not finite, the nearest ones that make sense are taken.
struct DopplerSettings {
    DopplerMode mode = DopplerMode::off;

    // Colour box: part of the probe's face, [0, 1] from its left end, and depths. A linear probe
    // steers it.
    double box_left = 0.25, box_right = 0.75;
    double box_top_mm = 15, box_bottom_mm = 45;
    double steer_deg = 0;  // [-30, 30], linear probes: of colour and spectral beams

    double scale_cm_s = 30;            // Nyquist limit, [1, 500]: velocities beyond it wrap around
    double spectral_scale_cm_s = 100;  // that of the spectrum
    double baseline = 0;               // shift of zero, part of the scale, [-0.9, 0.9]
    bool invert = false;
    double wall_filter = 0.1;  // cut-off, part of the scale, [0, 0.5]
    double gain_db = 0;        // [-30, 30]
    double priority = 0.5;     // grey above this part of white stays grey, [0, 1]
    int ensemble = 10;         // pulses a line, [4, 16]
    int persistence = 2;       // frames, [1, 4]

    // Spectral gate and M-mode line: part of the face, and the gate's middle and length.
    double gate_line = 0.5;
    double gate_depth_mm = 30;
    double gate_mm = 3;  // [0.5, 30]
    double angle_deg =
        60;  // that the angle cursor says, [-80, 80]; velocities are divided by its cosine
    double diameter_mm = 0;  // as measured in the picture, for volume flow; 0: not measured
    int gate_points = 64;    // [8, 1024]: see docs/flow.md for what they cost

    friend bool operator==(const DopplerSettings&, const DopplerSettings&) = default;
};

}  // namespace sonocase::runtime
