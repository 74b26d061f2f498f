// SPDX-License-Identifier: Apache-2.0

// What a Doppler mode showed in a frame, beside what was true there: for recordings and scores.
#pragma once

#include <array>

namespace sonocase::runtime {

// Labels are palette indices of the bundle; -1: none.
struct DopplerReport {
    bool on = false;  // mode colour, power or spectral

    // Colour and power: the vessels with most cells in colour, at least kColouredCells and
    // kColouredPart of those that the box holds of each.
    static constexpr int kColouredCells = 12;
    static constexpr double kColouredPart = 0.4;
    std::array<int, 4> coloured{-1, -1, -1, -1};

    // Spectral: the vessel that most of the gate lies in.
    int gate_label = -1;
    double gate_fill = 0;      // share of the gate that lies in its blood
    double angle_deg = 0;      // between beam and flow there, [0, 90]
    double cursor_deg = 0;     // that the angle cursor says, [0, 80]
    int beats = 0;             // that were measured since a setting changed
    double psv_cm_s = 0;       // peak systolic velocity as measured, by the cursor
    double true_psv_cm_s = 0;  // fastest blood of that vessel there, in the same beats
};

}  // namespace sonocase::runtime
