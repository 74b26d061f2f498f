// SPDX-License-Identifier: Apache-2.0

// What truth and Doppler modes share with the picture that they accompany: which effects move
// tissue, how the picture is laid out, and where a point of it is looked up in the anatomy.
#pragma once

#include <optional>
#include <span>
#include <vector>

#include "formats/base/result.h"
#include "formats/bundle/case_bundle.h"
#include "formats/exercise/exercise.h"
#include "formats/exercise/motion.h"
#include "runtime/imaging/core/image_formation.h"
#include "runtime/imaging/core/render_options.h"
#include "runtime/imaging/core/scan_geometry.h"
#include "runtime/imaging/press/press_field.h"
#include "runtime/imaging/renderer.h"

namespace sonocase::runtime {

// Which of an image model's effects move tissue.
struct MovingEffects {
    bool contact = false, breathing = false, pulsation = false, deformation = false;
};
// Errors: those of choose_effects.
Result<MovingEffects> moving_effects(const RenderOptions& options);

// The geometry that a renderer of these options draws in.
ScanGeometry shown_geometry(const Exercise& exercise, const RenderOptions& options);

// Where the beams of one frame meet the skin, one value per ray; rays divide the face evenly, ray i
// lies in the middle of its part.
struct RayContact {
    std::vector<float> gap_mm;    // closed by contact; negative: the beam sees air
    std::vector<float> entry_mm;  // along the beam from the face to the skin; NaN: none found
    bool any_gap = false;
    int touching = 0;  // number of beams (not rays) in contact
};

// The breathing weight on a lattice of its own, for vector look-ups: the values of BreathingField
// at the middles of its cells, and a rim of zeros around them.
struct BreathingLattice {
    Int3 size{0, 0, 0};
    float first_vx[3] = {0, 0, 0};  // voxel coordinates of its first point
    float per_voxel = 0;
    std::vector<float> weight;  // x fastest
};

// Where a point of the scan plane is looked up in the anatomy: the only place that knows how
// contact, pressing and breathing move tissue from where it lies at rest to where the picture shows
// it.
class PlaneLookUp {
  public:
    PlaneLookUp(CaseView bundle,
                const Exercise& exercise,
                bool contact,
                bool breathing,
                bool pulsation,
                const ScanGeometry& geometry,
                int rays);

    // Begins a frame: finds where the beams touch and how the tissue has moved. press: the field of
    // the picture; null: nothing is pressed. The pose is where bone holds the face. rendered: what
    // a renderer of the same geometry found for it; its gaps are not looked for again.
    void begin(const Rigid& mannequin_from_probe,
               double time_s,
               bool wants_entry,
               const press::PressField* press,
               const RenderedFrame& rendered = {});

    const RayContact& contact() const { return contact_; }
    const MotionState& motion() const { return motion_; }
    const BreathingLattice* breathing() const {
        return motion_.breathes() && !lattice_.weight.empty() ? &lattice_ : nullptr;
    }
    static double contact_reach_mm();

    // Where the tissue that the plane's point p shows is now, and where it lies at rest. gap_mm:
    // gap of its beam.
    Point3 shown(PlanePoint p, double gap_mm) const;
    // line, r_mm: beam and depth of p.
    Point3 rest(PlanePoint p, double line, double r_mm, double gap_mm) const;
    // A place less the breathing that carries its tissue.
    Point3 without_breathing(Point3 now) const;
    // True if p lies in a collapsed lumen: the picture shows the tissue around it.
    bool closed(PlanePoint p, double line, double r_mm) const;
    // The ray, as a fraction, at a beam's position across the face.
    double ray_of(double line) const;
    double gap_at(double ray) const;
    double entry_at(double ray) const;

  private:
    void find_gaps();
    void spread_gaps(std::span<const float> gaps);
    void find_entries();
    void press_entries();
    double entry_along(PlanePoint origin, PlanePoint direction) const;
    bool body_at(Point3 mannequin) const;

    CaseView bundle_;
    const ScanGeometry& geometry_;
    bool contact_on_, breathing_on_;
    BreathingMotion breathing_motion_;
    Pulsation pulsation_;
    BreathingField field_;
    BreathingLattice lattice_;
    Rigid pose_;
    MotionState motion_;
    RayContact contact_;
    const press::PressField* press_ = nullptr;
    std::vector<float> raw_, gaps_;  // # scanlines
};

}  // namespace sonocase::runtime
