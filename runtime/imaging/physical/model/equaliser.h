// SPDX-License-Identifier: Apache-2.0

// Effect equalisation: a machine evens out gain across its beams. Where one beam is brighter or
// darker than those beside it over a stretch of some millimetres (a shadow's column, a brighter
// lobe), its gain goes half the way to theirs. What differs over less along the beam stays, and so
// does shading that is wider than the neighbourhood.
//
// In cells of kHazeCell samples of one beam, e: mean envelope,
//     N = e under a triangle of deviation kEvenAlongMm along the beam, then 1 2 1 across
//     W = N over cells of kHazeCell beams, then a triangle of deviation about kEvenAcross of all
//     d = W / N - 1, by kEvenSpeckle nearer to 0, since speckle alone makes it differ by so much
//     power gain = 1 + amount ramp(r) (clamp(1 + d, 1/2, 2) - 1)
// between the middles of the cells along the beam; ramp: 0 up to from_mm, 1 from kEvenRampMm
// further on. Half the way in amplitude is W / N in power. A cell without echo stays as it is.
#pragma once

#include <algorithm>

#include "runtime/imaging/physical/model/physical_tables.h"

namespace sonocase::runtime::physical {

inline constexpr double kEvenAlongMm = 4.9, kEvenAcross = 0.047, kEvenRampMm = 10;
inline constexpr double kMostEven = 2;        // of power, and one over it
inline constexpr double kEvenSpeckle = 0.08;  // of W / N
inline constexpr float kEvenNothing = 1e-4f;  // mean envelope that counts as no echo

// The gain of power where W / N is `ratio`, before amount and ramp.
template <class Number>
Number even_gain(Number ratio) {
    const Number differs = ratio - 1, speckle = static_cast<Number>(kEvenSpeckle);
    const Number left = differs - std::clamp(differs, -speckle, speckle);
    return 1 + std::clamp(left, static_cast<Number>(1 / kMostEven - 1),
                          static_cast<Number>(kMostEven - 1));
}

inline bool has_equalisation(const Tables& t) {
    return t.machine.equalisation.amount > 0;
}

// Half widths of the triangles: cells along the beam, and cells across.
int even_reach_along(const ScanGeometry& geometry);
int even_reach_across(const ScanGeometry& geometry);
// What of the gain counts at a row of cells: amount times ramp.
double even_share(const ScanGeometry& geometry, const Tables& tables, int cell_row);

}  // namespace sonocase::runtime::physical
