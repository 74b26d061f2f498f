// SPDX-License-Identifier: Apache-2.0

// From the stresses in the columns to where their tissue lies, and the map from the pressed picture
// to the tissue at rest, as tables over columns and depths.
#pragma once

#include <array>
#include <cstdint>

#include "runtime/imaging/press/press_elastic.h"

namespace sonocase::runtime::press {

struct PressColumns {
    Plane<kFineRows> stretch;  // pressed height over resting height of each part, > 0
    Plane<kFineRows> lumen;    // stretch of the lumen in it; only rows of PressSamples::lumen
    Plane<kFineRows + 1> pressed_mm;       // depth from the face of each part's upper edge
    std::array<float, kColumns> factor{};  // factor that the stresses were multiplied by
    double force_n = 0;
};

// Finds the stretches of every part by the laws of press_law.h. The stresses of a column under the
// face are multiplied by one factor (Newton), so that its stretches add up to the pressed depth,
// and its heights by another, which makes that exact; both are near 1. A lumen of small stretch
// closes.
//
// Every stretch is positive, so depth rises along each column: it can be inverted. Force in
// newtons as press_law.h says, over all columns. Cost: 15 us.
void stretch_columns(SimdTarget simd,
                     const PressSamples& samples,
                     const PressFace& face,
                     const PressElastic& elastic,
                     PressColumns& out);

inline constexpr int kTableRows = 241;
inline constexpr double kTableStepMm = 0.3;  // 72 mm in all; nothing moves below
inline constexpr double kTableFadeMm = 20;   // what is left there, and beside the table, fades
// Rows of the sideways shift, which is smooth: one for every five rows of the table.
inline constexpr int kBulgeEvery = 5, kBulgeRows = (kTableRows - 1) / kBulgeEvery + 1;

// What lies pressed at (X, r), X along the face and r from it, lies at rest at
//
//     x = X - V(X, r),   depth R(x, r) from the face,
//
// V and R bilinear between their nodes, which lie under the columns.
struct PressTable {
    Plane<kBulgeRows> bulge_mm;  // V, at r = n * kBulgeEvery * kTableStepMm
    Plane<kTableRows> rest_mm;   // R, at r = m * kTableStepMm
    std::array<std::int32_t, kTableRows * kStride> part;  // for building: part of a row at a node
    float min_determinant = 1;  // lower bound of the map's determinant everywhere
};

// Inverts every column, and finds what the columns squeeze out sideways:
//
//     e = max(0, 1 - l), at most 0.95, 0 in lumens;   (1 - 4^2 d_rr) e' = e;
//     V_X = e' - (1 - 20^2 d_XX)^-1 e'
//
// The map cannot fold, so that no test is needed: the determinant is dx/dX times dR/dr. Both
// smoothings are means, so V_X < 0.95 at the nodes, and between them it is a mean of theirs. R
// rises with r at the nodes, and so does a mean of two columns. The bound is the product of the
// two minima. Cost: 30 us.
void build_table(SimdTarget simd,
                 const PressSamples& samples,
                 const PressFace& face,
                 const PressColumns& columns,
                 PressTable& out);

}  // namespace sonocase::runtime::press
