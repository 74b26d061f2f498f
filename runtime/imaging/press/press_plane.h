// SPDX-License-Identifier: Apache-2.0

// The press field along the beams of a scan geometry.
#pragma once

#include "runtime/imaging/press/press_field.h"
#include "runtime/imaging/scan/scan_geometry.h"

namespace sonocase::runtime::press {

// From a place on a beam to where its tissue lies at rest: along the beam, and sideways in the
// plane, towards the next beam.
struct PlaneShift {
    double along_mm = 0, side_mm = 0;
    double tilt = 0;  // of along_mm per mm sideways
};

// Unit vector beside a beam, towards the next one.
inline PlanePoint beside(PlanePoint direction) {
    return {direction.z, -direction.x};
}

// A probe's face as the press field knows it. Half its height: 4 mm for linear, 6.5 for convex and
// 5 for phased arrays (a).
PressFace press_face(const Probe& probe);

// True where each beam is a column's own: all but phased arrays, whose beams cross columns.
inline bool follows_columns(const ScanGeometry& g) {
    return !g.fan || g.radius_mm > 0;
}

// Place of a beam along the face, mm; a beam may be a fraction.
inline double lateral_of_line(const ScanGeometry& g, double line) {
    const double across = -g.half_extent + (line + 0.5) * g.line_step;
    return g.fan ? g.radius_mm * across : across;
}

// line: of `beam`, a fraction is allowed. Relative to the face where bone holds it. For a turn of
// the beam by a small angle e its sine counts as e and its cosine as 1 - e^2 / 2: 0.002 mm. Cost:
// 25 ns.
inline PlaneShift plane_shift(const PressField& field,
                              const ScanGeometry& g,
                              const ScanGeometry::Beam& beam,
                              double line,
                              double r_mm) {
    if (!follows_columns(g)) {
        const PlanePoint p{beam.origin.x + r_mm * beam.direction.x,
                           beam.origin.z + r_mm * beam.direction.z};
        const RestPlace rest = field.rest_in_plane({p.x, p.z});
        const double x = rest.lateral_mm - p.x, z = rest.depth_mm - p.z;
        const PlanePoint n = beside(beam.direction);
        return {x * beam.direction.x + z * beam.direction.z, x * n.x + z * n.z, 0};
    }
    const double lateral = lateral_of_line(g, line);
    const RestPlace rest = field.rest_in_plane({lateral, r_mm});
    const double v = rest.lateral_mm - lateral, per_mm = g.fan ? 1 / g.radius_mm : 0;
    const double grow = 1 + rest.depth_mm * per_mm;
    return {rest.depth_mm - r_mm - 0.5 * v * v * per_mm * grow, v * grow, rest.tilt};
}

// The place itself, in the plane.
inline PlanePoint rest_point(const PressField& field,
                             const ScanGeometry& g,
                             const ScanGeometry::Beam& beam,
                             double line,
                             double r_mm) {
    const PlaneShift s = plane_shift(field, g, beam, line, r_mm);
    const PlanePoint n = beside(beam.direction);
    const double along = r_mm + s.along_mm;
    return {beam.origin.x + along * beam.direction.x + s.side_mm * n.x,
            beam.origin.z + along * beam.direction.z + s.side_mm * n.z};
}

// What `scan` shows at the place where tissue lies that is at `rest` when nothing is pressed.
inline PlanePoint shown_point(const PressField& field, PlanePoint rest) {
    const BeamPoint shown =
        field.shown_in_plane(beam_point(field.face(), Point3{rest.x, 0, rest.z}));
    const Point3 p = probe_point(field.face(), shown, 0);
    return {p.x, p.z};
}

}  // namespace sonocase::runtime::press
