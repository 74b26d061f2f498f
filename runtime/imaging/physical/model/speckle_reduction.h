// SPDX-License-Identifier: Apache-2.0

// Effect speckle_reduction: a machine smooths even ground and leaves the detail of what it takes
// for structure, so that smooth regions lie beside busy ones. Which is which belongs to the tissue
// here: a smooth noise of it.
//
// In cells of kHazeCell samples of one beam, e: mean envelope, g: gain of power of `equalisation`,
//     M = e under a triangle of deviation kDetailAlongMm along the beam, then the mean of the
//         beams within kDetailAcross of all, to each side
//     middle = log2(g M^2) + kDetailMiddle
//     contrast = clamp(1 + variation ramp(r) n, kLeastContrast, kMostContrast)
// between the middles of the cells along the beam, and for every sample
//     log2 power += (contrast - 1) clamp(log2 power - middle, -kMostDetail, kMostDetail)
// n: `strength` of TissueLayers, of unit deviation; ramp: 0 down to from_mm, 1 from kDetailRampMm
// further on. What stands out by more than kMostDetail, such as a surface, moves no further.
// Source: a living liver's sweep; the figures (a).
#pragma once

#include <algorithm>

#include "runtime/imaging/physical/model/physical_tables.h"

namespace sonocase::runtime::physical {

inline constexpr double kDetailAlongMm = 1.6, kDetailAcross = 0.021, kDetailRampMm = 15;
inline constexpr double kLeastContrast = 0.25, kMostContrast = 1.75;
inline constexpr int kMaxDetailReach = 8;  // beams
inline constexpr double kMostDetail = 3;   // log2 of power: 9 dB
// Mean grey stays: that of two looks under an exponent of 0.75, d/dw of the mean of e^0.75 = 0.
inline constexpr double kDetailMiddle = 0.1;

inline bool has_speckle_reduction(const Tables& t) {
    return t.machine.speckle_reduction.variation > 0;
}

// Half width of the triangle along the beam, in cells, and of the mean across, in beams.
int detail_reach_along(const ScanGeometry& geometry);
int detail_reach_across(const ScanGeometry& geometry);
// variation times ramp, at a row of cells.
double detail_variation(const ScanGeometry& geometry, const Tables& tables, int cell_row);

// contrast - 1 of a place whose variation times noise is `x`.
template <class Number>
Number contrast_change(Number x) {
    return std::clamp(x, static_cast<Number>(kLeastContrast - 1),
                      static_cast<Number>(kMostContrast - 1));
}

}  // namespace sonocase::runtime::physical
