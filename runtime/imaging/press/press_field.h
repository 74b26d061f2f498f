// SPDX-License-Identifier: Apache-2.0

// Tissue that yields to the probe: where the tissue that the picture shows lies at rest.
//
//     PressField field(face);
//     if (field.press(simd, scene)) rest = field.pull_back(place);
//
// Solved afresh from the pose alone: no history, so that lifting the probe gives the picture of
// before, and a jump of the pose leaves no trace. Points are in the frame `probe` of the pose; the
// face may lie anywhere, 200 mm inside the body or in the air. Nothing is allocated after the
// constructor. Source, accuracy and limits: docs/deformation.md.
#pragma once

#include <memory>

#include "runtime/imaging/press/press_closed.h"
#include "runtime/imaging/press/press_table.h"
#include "runtime/needle/needle_shift.h"

namespace sonocase::runtime::press {

struct PressOptions {
    PressSolveOptions solve;
    double stiffness_scale = 1;  // of every tissue, > 0: a firm body or a soft one
};

struct PressState {
    bool pressed = false;         // else nothing moves, and the field is the identity
    double force_n = 0;           // on the whole face
    double pressure_kpa = 0;      // over the part of it that touches
    double excess_mm = 0;         // by how much bone held the probe back, along z
    double deepest_mm = 0;        // greatest pressed depth, after the excess
    double farthest_mm = 0;       // no tissue of the plane moves further
    double vein_open = -1;        // open area of the lumens over that at rest; < 0: none
    bool out_of_reach = false;    // more than 30 mm inside the body: as if 30
    float least_determinant = 1;  // of the map from the picture to the tissue: never 0 or less
};

// Where tissue that the picture shows lies at rest.
struct RestPlace {
    double lateral_mm = 0, depth_mm = 0;
    double tilt = 0;  // of the rest depth per mm along the face
};

class PressField {
  public:
    explicit PressField(const PressFace& face);

    // True when something is pressed. Cost: 0.2 ms with AVX2; where nothing touches, the look-up of
    // the skin and the columns.
    bool press(SimdTarget simd, const PressScene& scene, const PressOptions& options = {});
    void lift();  // nothing is pressed
    // A needle that moves tissue as well, in the frame of the pose, relative to the face where bone
    // holds it. Pictures show it (the functions for the scan plane); pull_back and push_forward, by
    // which the needle itself finds its layers, leave it out.
    void dent(const NeedleDent& needle) { dent_ = needle; }
    const NeedleDent& needle() const { return dent_; }
    bool moves() const { return state_.pressed || dent_.moves(); }
    // No tissue of the plane moves further.
    double farthest_mm() const;
    // Another number after each change of what is pressed.
    std::uint32_t version() const { return version_; }

    const PressState& state() const { return state_; }
    const PressFace& face() const { return face_; }
    const PressTable& table() const { return work_->table; }
    const PressSamples& samples() const { return work_->samples; }
    const PressColumns& columns() const { return work_->columns; }

    // Where the tissue that lies at `pressed` now lies at rest, in the frame of the pose as it was
    // given, also where bone holds the face back. Continuous everywhere: beside the
    // table the shift fades over 20 mm, across the plane as press_law.h says.
    Point3 pull_back(Point3 pressed) const;
    // Where the tissue that lies at `rest` is now: the inverse to 1e-4 mm. Cost: 40 pull-backs.
    Point3 push_forward(Point3 rest) const;

    // The same in the scan plane alone, as renderers ask for it: relative to the face where bone
    // holds it, state().excess_mm behind the pose; first where the needle, then where the probe
    // moved the tissue from. Cost: 20 ns.
    RestPlace rest_in_plane(BeamPoint shown) const;
    // What the probe alone does to it.
    RestPlace pressed_in_plane(BeamPoint shown) const;
    BeamPoint shown_in_plane(BeamPoint rest) const;  // the inverse
    // Depth of the pressed skin below the face: 0 where it touches.
    double skin_now_mm(double lateral_mm) const;
    bool closed_in_plane(BeamPoint shown) const;  // nearest node of closed_nodes()
    const PressClosed& closed_nodes() const { return work_->closed; }

    // True where `rest`, a place in a draining lumen, lies between walls that touch: the lumen's
    // stretch is below 0.2 there or in the column beside it. A picture shows the wall instead, also
    // where a lumen is too small for the columns to close it without a rest.
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
    std::uint32_t version_ = 0;
};

}  // namespace sonocase::runtime::press
