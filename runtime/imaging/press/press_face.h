// SPDX-License-Identifier: Apache-2.0

// The probe's face and the grid of the press field below it: 48 columns along the beams, 32 of them
// over the face, and 40 rows of depth below each column's own resting skin. Each row is halved
// where stretches are worked out, so that a small lumen is cut where its wall is and not where a
// row ends.
//
// Rows: 30 of 1.25 mm, then each 1.22 times as high as the last but at most 7 mm, 71.6 mm in all.
#pragma once

#include <array>

#include "formats/base/geometry.h"

namespace sonocase::runtime::press {

inline constexpr int kColumns = 48, kFaceColumns = 32, kSideColumns = 8;
inline constexpr int kRows = 40;
inline constexpr int kParts = 2;  // parts of a row
inline constexpr int kFineRows = kRows * kParts;
// Zeros beside the columns of a row, so that reading to the left or right needs no test.
inline constexpr int kMargin = 8, kStride = kColumns + 2 * kMargin;

using RowEdges = std::array<double, kRows + 1>;
using FineEdges = std::array<double, kFineRows + 1>;

constexpr RowEdges row_edges() {
    RowEdges t{};
    double height = 1.25;
    for (int k = 0; k < kRows; ++k) {
        if (k >= 30) height = height * 1.22 < 7 ? height * 1.22 : 7;
        t[k + 1] = t[k] + height;
    }
    return t;
}
inline constexpr RowEdges kRowEdge = row_edges();  // mm below the skin

constexpr FineEdges fine_edges() {
    FineEdges t{};
    for (int j = 0; j <= kFineRows; ++j) {
        const int k = j / kParts < kRows ? j / kParts : kRows - 1;
        const double low = kRowEdge[k];
        const double high = kRowEdge[k + 1];
        t[j] = low + (high - low) * (j - k * kParts) / kParts;
    }
    return t;
}
inline constexpr FineEdges kFineEdge = fine_edges();

constexpr double row_height(int k) {
    return kRowEdge[k + 1] - kRowEdge[k];
}
constexpr double row_middle(int k) {
    return (kRowEdge[k + 1] + kRowEdge[k]) / 2;
}
constexpr double fine_height(int j) {
    return kFineEdge[j + 1] - kFineEdge[j];
}

// One number per column for each of some rows, with margins of zeros.
template <int kHeight>
struct Plane {
    alignas(64) std::array<float, kHeight * kStride> values{};
    float* row(int k) { return values.data() + k * kStride + kMargin; }
    const float* row(int k) const { return values.data() + k * kStride + kMargin; }
};

// The probe's face. Columns run along its beams: parallel below a flat face, fanning out below a
// curved one.
struct PressFace {
    double half_width_mm = 20;  // along the face, along its arc where it is curved; > 0
    double half_height_mm = 4;  // across the scan plane: 4 for linear probes, 6 to 7 for convex
    double radius_mm = 0;       // radius of curvature; 0: flat
};

// A place in the scan plane: along the face (arc length from its middle) and along the beam.
struct BeamPoint {
    double lateral_mm = 0, depth_mm = 0;
};

inline double column_width_mm(const PressFace& face) {
    return 2 * face.half_width_mm / kFaceColumns;
}
// Place of column i, which may be a fraction; the middle of the face lies between columns 23 and
// 24.
inline double column_lateral_mm(const PressFace& face, double i) {
    return (i - (kColumns - 1) / 2.0) * column_width_mm(face);
}

BeamPoint beam_point(const PressFace& face, Point3 probe);  // drops y
Point3 probe_point(const PressFace& face, BeamPoint p, double y);
// Origin on the face and unit direction of the beam at `lateral_mm`.
struct PressBeam {
    Point3 origin;
    Vector3 direction;
};
PressBeam press_beam(const PressFace& face, double lateral_mm);

// The beams in the middle of the columns, and a quarter of a column to the left and to the right.
using ColumnBeams = std::array<PressBeam, kColumns>;
struct PressBeams {
    ColumnBeams middle, left, right;
    explicit PressBeams(const PressFace& face);
};

}  // namespace sonocase::runtime::press
