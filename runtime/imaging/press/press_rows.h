// SPDX-License-Identifier: Apache-2.0

// The grid of the press field: 48 columns along the beams, 32 of them over the face, and 40 rows of
// depth below each column's own resting skin. Each row is halved where stretches are worked
// out, so that a small lumen is cut where its wall is and not where a row ends.
//
// Rows: 30 of 1.25 mm, then each 1.22 times as high as the last, 7 mm at most, 71.6 mm in all.
#pragma once

#include <array>

namespace sonocase::runtime::press {

inline constexpr int kColumns = 48, kFaceColumns = 32, kSideColumns = 8;
inline constexpr int kRows = 40;
inline constexpr int kParts = 2;  // of a row
inline constexpr int kFineRows = kRows * kParts;
// Beside the columns of a row, so that a look to the left or right needs no test; always zero.
inline constexpr int kMargin = 8, kStride = kColumns + 2 * kMargin;

using RowEdges = std::array<double, kRows + 1>;
using FineEdges = std::array<double, kFineRows + 1>;

constexpr RowEdges row_edges() {
    RowEdges t{};
    double height = 1.25;
    for (int k = 0; k < kRows; ++k) {
        if (k >= 30) height = height * 1.22 < 7 ? height * 1.22 : 7;
        t[static_cast<std::size_t>(k + 1)] = t[static_cast<std::size_t>(k)] + height;
    }
    return t;
}
inline constexpr RowEdges kRowEdge = row_edges();  // mm below the skin

constexpr FineEdges fine_edges() {
    FineEdges t{};
    for (int j = 0; j <= kFineRows; ++j) {
        const int k = j / kParts < kRows ? j / kParts : kRows - 1;
        const double low = kRowEdge[static_cast<std::size_t>(k)];
        const double high = kRowEdge[static_cast<std::size_t>(k + 1)];
        t[static_cast<std::size_t>(j)] = low + (high - low) * (j - k * kParts) / kParts;
    }
    return t;
}
inline constexpr FineEdges kFineEdge = fine_edges();

constexpr double row_height(int k) {
    return kRowEdge[static_cast<std::size_t>(k + 1)] - kRowEdge[static_cast<std::size_t>(k)];
}
constexpr double row_middle(int k) {
    return (kRowEdge[static_cast<std::size_t>(k + 1)] + kRowEdge[static_cast<std::size_t>(k)]) / 2;
}
constexpr double fine_height(int j) {
    return kFineEdge[static_cast<std::size_t>(j + 1)] - kFineEdge[static_cast<std::size_t>(j)];
}

// One number per column for each of some rows, with margins of zeros.
template <int kHeight>
struct Plane {
    alignas(64) std::array<float, static_cast<std::size_t>(kHeight) * kStride> values{};
    float* row(int k) { return values.data() + k * kStride + kMargin; }
    const float* row(int k) const { return values.data() + k * kStride + kMargin; }
};

}  // namespace sonocase::runtime::press
