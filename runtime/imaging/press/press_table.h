// SPDX-License-Identifier: Apache-2.0

// The map from the pressed picture to the tissue at rest, as tables over columns and depths.
#pragma once

#include <array>
#include <cstdint>

#include "runtime/imaging/press/press_columns.h"

namespace sonocase::runtime::press {

inline constexpr int kTableRows = 241;
inline constexpr double kTableStep_mm = 0.3;  // 72 mm in all: below, nothing moves
inline constexpr double kTableFade_mm = 20;   // what is left there, and beside it, fades
// Rows of the sideways shift, which is smooth: one for every five of the other.
inline constexpr int kBulgeEvery = 5, kBulgeRows = (kTableRows - 1) / kBulgeEvery + 1;

// What lies pressed at (X, r), X along the face and r from it, lies at rest at
//
//     x = X - V(X, r),   depth R(x, r) from the face,
//
// V and R bilinear between their nodes, which lie under the columns.
struct PressTable {
    Plane<kBulgeRows> bulge_mm;  // V, at r = n * kBulgeEvery * kTableStep_mm
    Plane<kTableRows> rest_mm;   // R, at r = m * kTableStep_mm
    std::array<std::int32_t, kTableRows * kStride>
        part;                     // for building it: part of a row at a node
    float least_determinant = 1;  // lower bound of that of the map, everywhere
};

// Inverts every column, and finds what the columns squeeze out sideways:
//
//     e = max(0, 1 - l), at most 0.95, 0 in lumens;   (1 - 4^2 d_rr) e' = e;
//     V_X = e' - (1 - 20^2 d_XX)^-1 e'
//
// No fold, and no test for one: the determinant is dx/dX times dR/dr. Both smoothings are means, so
// V_X < 0.95 at the nodes, and between them it is a mean of theirs. R rises with r at the nodes,
// and so does a mean of two columns. The bound is the least of the one times the least of the
// other. Cost: 30 us.
void build_table(SimdTarget simd,
                 const PressSamples& samples,
                 const PressFace& face,
                 const PressColumns& columns,
                 PressTable& out);

}  // namespace sonocase::runtime::press
