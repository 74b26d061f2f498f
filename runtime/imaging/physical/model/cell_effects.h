// SPDX-License-Identifier: Apache-2.0

// Effects equalisation and speckle_reduction: what the machine does to means of the envelope over
// cells of kHazeCell samples of one beam.
#pragma once

#include <algorithm>
#include <cmath>

#include "runtime/imaging/physical/model/physical_tables.h"

namespace sonocase::runtime::physical {

// Half width, at least `lowest`, of the triangle over cells that has this variance; the variance of
// one of half width n is n (n + 2) / 6.
inline int cell_reach(double variance, int lowest) {
    constexpr int kMax = 8;
    return std::clamp(static_cast<int>(std::lround(std::sqrt(1 + 6 * std::max(variance, 0.0)) - 1)),
                      lowest, kMax);
}

// Effect equalisation: a machine evens out gain across its beams. Where one beam is brighter or
// darker than those beside it over a stretch of some millimetres (a shadow's column, a brighter
// lobe), its gain goes half the way to theirs. What differs over less along the beam stays, and so
// does shading that is wider than the neighbourhood.
//
// In cells of kHazeCell samples of one beam, e: mean envelope,
//     N = e under a triangle of deviation kEvenAlongMm along the beam, then 1 2 1 across
//     W = N over cells of kHazeCell beams, then a triangle of deviation about kEvenAcross of all
//     d = W / N - 1, moved kEvenSpeckle towards 0, since speckle alone makes that difference
//     power gain = 1 + amount ramp(r) (clamp(1 + d, 1/2, 2) - 1)
// between the middles of the cells along the beam; ramp: 0 up to from_mm, 1 from kEvenRampMm
// further on. Half the way in amplitude is W / N in power. A cell without echo stays as it is.

inline constexpr double kEvenAlongMm = 4.9, kEvenAcross = 0.047, kEvenRampMm = 10;
inline constexpr double kMaxEven = 2;         // greatest gain of power; the least is one over it
inline constexpr double kEvenSpeckle = 0.08;  // in W / N
inline constexpr float kEvenNothing = 1e-4f;  // mean envelope that counts as no echo

// The gain of power where W / N is `ratio`, before amount and ramp.
template <class Number>
Number even_gain(Number ratio) {
    const Number differs = ratio - 1, speckle = static_cast<Number>(kEvenSpeckle);
    const Number left = differs - std::clamp(differs, -speckle, speckle);
    return 1 + std::clamp(left, static_cast<Number>(1 / kMaxEven - 1),
                          static_cast<Number>(kMaxEven - 1));
}

inline bool has_equalisation(const Tables& t) {
    return t.machine.equalisation.amount > 0;
}

// Half widths of the triangles: cells along the beam, and cells across.
int even_reach_along(const ScanGeometry& geometry);
int even_reach_across(const ScanGeometry& geometry);
// Share of the gain that counts at a row of cells: amount times ramp.
double even_share(const ScanGeometry& geometry, const Tables& tables, int cell_row);

// Effect speckle_reduction: a machine smooths even ground and leaves the detail of what it takes
// for structure, so that smooth regions lie beside busy ones. Here a smooth noise of the tissue
// decides which is which.
//
// In cells of kHazeCell samples of one beam, e: mean envelope, g: gain of power of `equalisation`,
//     M = e under a triangle of deviation kDetailAlongMm along the beam, then the mean of the
//         beams within kDetailAcross of all, to each side
//     middle = log2(g M^2) + kDetailMiddle
//     contrast = clamp(1 + variation ramp(r) n, kMinContrast, kMaxContrast)
// between the middles of the cells along the beam, and for every sample
//     log2 power += (contrast - 1) clamp(log2 power - middle, -kMaxDetail, kMaxDetail)
// n: `strength` of TissueLayers, of unit deviation; ramp: 0 down to from_mm, 1 from kDetailRampMm
// further on. What stands out by more than kMaxDetail, such as a surface, moves no further. The
// figures are fitted to a tracked sweep of a living liver (docs/realism.md).

inline constexpr double kDetailAlongMm = 1.6, kDetailAcross = 0.021, kDetailRampMm = 15;
inline constexpr double kMinContrast = 0.25, kMaxContrast = 1.75;
inline constexpr int kMaxDetailReach = 8;  // beams
inline constexpr double kMaxDetail = 3;    // log2 of power: 9 dB
// Keeps the mean grey of two looks about as it is: d/dw of the mean of e^0.75 = 0.
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
    return std::clamp(x, static_cast<Number>(kMinContrast - 1),
                      static_cast<Number>(kMaxContrast - 1));
}

}  // namespace sonocase::runtime::physical
