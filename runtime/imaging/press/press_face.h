// SPDX-License-Identifier: Apache-2.0

// The probe's face and the columns under it. A column runs along a beam: parallel below a flat
// face, fanning out below a curved one.
#pragma once

#include <array>

#include "formats/base/geometry.h"
#include "runtime/imaging/press/press_rows.h"

namespace sonocase::runtime::press {

struct PressFace {
    double half_width_mm = 20;  // along the face, along its arc where it is curved; > 0
    double half_height_mm = 4;  // across the scan plane: 4 for linear probes, 6 to 7 for convex
    double radius_mm = 0;       // of curvature; 0: flat
};

// A place in the scan plane: along the face (arc length from its middle) and along the beam.
struct BeamPoint {
    double lateral_mm = 0, depth_mm = 0;
};

inline double column_width_mm(const PressFace& face) {
    return 2 * face.half_width_mm / kFaceColumns;
}
// Of column i, which may be a fraction; the middle of the face lies between columns 23 and 24.
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

// Those of the columns, and a quarter of a column to the left and to the right of them.
using ColumnBeams = std::array<PressBeam, kColumns>;
struct PressBeams {
    ColumnBeams middle, left, right;
    explicit PressBeams(const PressFace& face);
};

}  // namespace sonocase::runtime::press
