// SPDX-License-Identifier: Apache-2.0

// Where a point of the scan plane is looked up in the anatomy: the one place that knows how
// contact, pressing and breathing move tissue from where it lies at rest to where the picture shows
// it.
#pragma once

#include <optional>
#include <span>
#include <vector>

#include "formats/bundle/streamed_bundle.h"
#include "formats/exercise/exercise.h"
#include "formats/exercise/motion.h"
#include "runtime/imaging/press/press_plane.h"
#include "runtime/imaging/renderer.h"
#include "runtime/imaging/scan/scan_geometry.h"

namespace sonocase::runtime {

// The beams' meeting with the skin in one frame, one value per ray; rays divide the face evenly,
// ray i in the middle of its part.
struct RayContact {
    std::vector<float> gap_mm;    // closed by contact; negative: the beam sees air
    std::vector<float> entry_mm;  // along the beam from the face to the skin; NaN: none found
    bool any_gap = false;
    int touching = 0;  // beams, not rays
};

// The breathing weight on a lattice of its own, for vector look-ups: the values of BreathingField
// at the middles of its cells, and a rim of zeros around them.
struct BreathingLattice {
    Int3 size{0, 0, 0};
    float first_vx[3] = {0, 0, 0};  // voxel coordinates of its first point
    float per_voxel = 0;
    std::vector<float> weight;  // x fastest
};

class PlaneLookUp {
  public:
    PlaneLookUp(CaseView bundle,
                const Exercise& exercise,
                bool contact,
                bool breathing,
                bool pulsation,
                const ScanGeometry& geometry,
                int rays);

    // Begins a frame: where the beams touch, and how the tissue stands. press: what yields to probe
    // and needle, as for the picture; null: nothing does. The pose is where bone holds the face.
    void begin(const Rigid& mannequin_from_probe,
               double time_s,
               bool wants_entry,
               const press::PressField* press);

    const RayContact& contact() const { return contact_; }
    const MotionState& motion() const { return motion_; }
    const BreathingLattice* breathing() const {
        return motion_.breathes() && !lattice_.weight.empty() ? &lattice_ : nullptr;
    }
    double contact_reach_mm() const;

    // Where the tissue that the plane's point p shows is now, and where it lies at rest. gap_mm:
    // of its beam.
    Point3 shown(PlanePoint p, double gap_mm) const;
    // line, r_mm: of p.
    Point3 rest(PlanePoint p, double line, double r_mm, double gap_mm) const;
    // A place less the breathing that carries its tissue.
    Point3 without_breathing(Point3 now) const;
    // p lies in a lumen that is pressed shut: the picture shows what is around it.
    bool shut(PlanePoint p, double line, double r_mm) const;
    // Fraction of the ray of a beam's position across the face.
    double ray_of(double line) const;
    double gap_at(double ray) const;
    double entry_at(double ray) const;

  private:
    void find_gaps_of_rays();
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
