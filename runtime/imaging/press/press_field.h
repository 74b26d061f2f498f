// SPDX-License-Identifier: Apache-2.0

// Tissue that yields to the probe: where the tissue that the picture shows lies at rest.
//
//     PressField field(face);
//     if (field.press(simd, scene)) rest = field.pull_back(place);
//
// The field is solved from the pose alone, without a history, so that lifting the probe gives the
// earlier picture and a jump of the pose leaves no trace. Points are in the frame `probe` of the
// pose; the face may lie anywhere, 200 mm inside the body or in the air. Nothing is allocated after
// the constructor. Source, accuracy and limits: docs/deformation.md.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <span>

#include "formats/exercise/pool_shift.h"
#include "runtime/imaging/core/needle_shift.h"
#include "runtime/imaging/core/scan_geometry.h"
#include "runtime/imaging/press/press_table.h"

namespace sonocase::runtime::press {

// Where a lumen is closed, at marks as far down as the nodes of PressTable::rest_mm and kMarks to a
// column along the face: 1 where the nearest tissue of the mark, or of one up to a column beside
// it, is a lumen whose walls touch. The picture shows the wall there instead of blood. A closed
// vein is a fraction of a millimetre high, less than the distance of nodes, so that the marks
// around it are set.
struct PressClosed {
    static constexpr int kMarks = 4, kAcross = (kColumns - 1) * kMarks + 1;
    std::array<std::int32_t, kTableRows * kAcross> mark{};
    std::array<bool, kTableRows> row{};            // some mark of the row
    std::array<bool, kFineRows * kAcross> part{};  // of rows: the same, at rest
    bool any = false;
    // Area of the draining lumens under the face that a picture shows open, over that at rest;
    // negative: that is less than 4 mm^2.
    double open = -1;

    std::int32_t* row_of(int m) { return mark.data() + m * kAcross; }
    const std::int32_t* row_of(int m) const { return mark.data() + m * kAcross; }
};

// Walls touch all along the way of a mark's column through a lumen or not at all: where its height
// there, over parts of rows that a lumen fills to at least half, is below kShut of its height at
// rest. Between columns all of these are linear. Cost: nothing where there is no lumen, 10 us where
// there is.
void mark_closed(std::span<const PressTissue> tissues,
                 const PressFace& face,
                 const PressSamples& samples,
                 const PressColumns& columns,
                 PressClosed& out);

struct PressOptions {
    PressSolveOptions solve;
    double stiffness_scale = 1;  // factor for every tissue, > 0: a firm body or a soft one
};

struct PressState {
    bool pressed = false;       // if not, nothing moves and the field is the identity
    double force_n = 0;         // on the whole face
    double pressure_kpa = 0;    // over the part of it that touches
    double excess_mm = 0;       // how far bone held the probe back, along z
    double deepest_mm = 0;      // greatest pressed depth, after the excess
    double farthest_mm = 0;     // no tissue of the plane moves further
    double vein_open = -1;      // open area of the lumens over that at rest; < 0: none
    bool out_of_reach = false;  // more than 30 mm inside the body: solved as if 30
    float min_determinant = 1;  // of the map from the picture to the tissue; always above 0
};

// Where tissue that the picture shows lies at rest.
struct RestPlace {
    double lateral_mm = 0, depth_mm = 0;
    double tilt = 0;  // change of the rest depth per mm along the face
};

class PressField {
  public:
    explicit PressField(const PressFace& face);

    // True when something is pressed. Cost: 0.2 ms with AVX2; where nothing touches, the look-up of
    // the skin and the columns.
    bool press(SimdTarget simd, const PressScene& scene, const PressOptions& options = {});
    void lift();  // from now on nothing is pressed
    // Adds a needle that moves tissue too, in the frame of the pose, relative to the face where
    // bone holds it. Pictures show it (the functions for the scan plane); pull_back and
    // push_forward, by which the needle itself finds its layers, leave it out.
    void dent(const NeedleDent& needle) { dent_ = needle; }
    const NeedleDent& needle() const { return dent_; }
    // Adds pools that push tissue aside (formats/exercise/pool_shift.h), in the frame of the pose
    // where bone holds the face, as the probe leaves them at rest; all of at least kMinPoolMm, at
    // most SceneChange::kMaxPools. Pictures show what they move in the plane; pull_back and
    // push_forward leave them out.
    void set_pools(std::span<const SceneChange::Pool> pools);
    std::span<const SceneChange::Pool> pools() const {
        return {pools_.data(), static_cast<std::size_t>(pool_count_)};
    }
    bool moves() const { return state_.pressed || dent_.moves() || pool_count_ > 0; }
    // No tissue of the plane moves further than this.
    double farthest_mm() const;
    // A number that changes whenever the pressed tissue does.
    std::uint32_t version() const { return version_; }

    const PressState& state() const { return state_; }
    const PressFace& face() const { return face_; }
    const PressTable& table() const { return work_->table; }
    const PressSamples& samples() const { return work_->samples; }
    const PressColumns& columns() const { return work_->columns; }

    // Where the tissue that is now at `pressed` lies at rest, in the frame of the pose as it was
    // given, also where bone holds the face back. Continuous everywhere: beside the table the shift
    // fades over 20 mm, across the plane as press_law.h describes.
    Point3 pull_back(Point3 pressed) const;
    // Where the tissue that lies at `rest` is now: the inverse to 1e-4 mm. Cost: 40 pull-backs.
    Point3 push_forward(Point3 rest) const;

    // The same in the scan plane alone, as renderers need it: relative to the face where bone holds
    // it, state().excess_mm behind the pose. Undoes first the needle's shift, then the probe's;
    // plane_shift() undoes that of pools as well. Cost: 20 ns.
    RestPlace rest_in_plane(BeamPoint shown) const;
    // Undoes the probe's shift alone.
    RestPlace pressed_in_plane(BeamPoint shown) const;
    BeamPoint shown_in_plane(BeamPoint rest) const;  // the inverse, by pools as well
    // Depth of the pressed skin below the face: 0 where it touches.
    double skin_now_mm(double lateral_mm) const;
    bool closed_in_plane(BeamPoint shown) const;  // nearest of closed_marks()
    const PressClosed& closed_marks() const { return work_->closed; }

    // True where `rest`, a place in a draining lumen, lies between walls that touch (mark_closed).
    // A picture shows the wall instead, also where a lumen is too small for the columns to close it
    // without a rest.
    bool closed(Point3 rest) const;

  private:
    struct Work {
        PressSamples samples;
        PressElastic elastic;
        PressColumns columns;
        PressTable table;
        PressClosed closed;
    };
    PressFace face_;
    PressBeams beams_;
    BeamPoint before_dent(BeamPoint shown) const;
    BeamPoint shown_before_dent(BeamPoint rest) const;

    std::unique_ptr<Work> work_;
    PressState state_;
    NeedleDent dent_;
    std::array<SceneChange::Pool, SceneChange::kMaxPools> pools_{};
    int pool_count_ = 0;
    std::uint32_t version_ = 0;
};

// Shift from a place on a beam to where its tissue lies at rest: along the beam, and sideways in
// the plane, towards the next beam.
struct PlaneShift {
    double along_mm = 0, side_mm = 0;
    double tilt = 0;  // change of along_mm per mm sideways
};

// Unit vector beside a beam, towards the next one.
inline PlanePoint beside(PlanePoint direction) {
    return {direction.z, -direction.x};
}

// The face of a probe. Half its height is 4 mm for linear, 6.5 for convex and 5 for phased arrays
// (assumed).
PressFace press_face(const Probe& probe);

// True where beams run along columns: for all but phased arrays, whose beams cross columns.
inline bool follows_columns(const ScanGeometry& g) {
    return !g.fan || g.radius_mm > 0;
}

// Place of a beam along the face, mm; a beam may be a fraction.
inline double lateral_of_line(const ScanGeometry& g, double line) {
    const double across = -g.half_extent + (line + 0.5) * g.line_step;
    return g.fan ? g.radius_mm * across : across;
}

// Undoes what pools have moved: adds to the shift `s` of a place at depth r_mm of a beam.
void shift_by_pools(std::span<const SceneChange::Pool> pools,
                    const ScanGeometry::Beam& beam,
                    double r_mm,
                    PlaneShift& s);

// The shift at depth r_mm of a beam, relative to the face where bone holds it. line: number of
// `beam`, may be a fraction. For a turn of the beam by a small angle e its sine counts as e and its
// cosine as 1 - e^2 / 2, which is good to 0.002 mm. Cost: 25 ns.
inline PlaneShift plane_shift(const PressField& field,
                              const ScanGeometry& g,
                              const ScanGeometry::Beam& beam,
                              double line,
                              double r_mm) {
    PlaneShift s;
    if (!follows_columns(g)) {
        const PlanePoint p{beam.origin.x + r_mm * beam.direction.x,
                           beam.origin.z + r_mm * beam.direction.z};
        const RestPlace rest = field.rest_in_plane({p.x, p.z});
        const double x = rest.lateral_mm - p.x, z = rest.depth_mm - p.z;
        const PlanePoint n = beside(beam.direction);
        s = {x * beam.direction.x + z * beam.direction.z, x * n.x + z * n.z, 0};
    } else {
        const double lateral = lateral_of_line(g, line);
        const RestPlace rest = field.rest_in_plane({lateral, r_mm});
        const double v = rest.lateral_mm - lateral, per_mm = g.fan ? 1 / g.radius_mm : 0;
        const double grow = 1 + rest.depth_mm * per_mm;
        s = {rest.depth_mm - r_mm - 0.5 * v * v * per_mm * grow, v * grow, rest.tilt};
    }
    if (!field.pools().empty()) shift_by_pools(field.pools(), beam, r_mm, s);
    return s;
}

// The place at rest itself, in the plane.
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

// Where the picture shows the tissue that lies at `rest` when nothing is pressed.
inline PlanePoint shown_point(const PressField& field, PlanePoint rest) {
    const BeamPoint shown =
        field.shown_in_plane(beam_point(field.face(), Point3{rest.x, 0, rest.z}));
    const Point3 p = probe_point(field.face(), shown, 0);
    return {p.x, p.z};
}

}  // namespace sonocase::runtime::press
