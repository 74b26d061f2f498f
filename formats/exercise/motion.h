// SPDX-License-Identifier: Apache-2.0

// How the anatomy moves: breathing and the arterial pulse, as functions of time.
//
// Breathing shifts a point by amplitude * (1 - cos(2 pi t / period)) / 2 along the direction of
// inspiration, times a weight in [0, 1] that depends on the place: 1 in the organs that move with
// the diaphragm, 0 at skin, bone and outside, smooth in between. The image samples tissue at its
// place at rest.
// The pulse widens arteries: their wall moves out by amplitude * pulse(t).
#pragma once

#include <cstdint>
#include <vector>

#include "formats/bundle/case_bundle.h"
#include "formats/exercise/exercise.h"

namespace sonocase {

struct MotionState {
    Vector3 breathing_mm;  // shift where the weight is 1
    double pulse_mm = 0;   // outward shift of arterial walls
    double vein_mm = 0;    // of the walls of veins: VeinState::wall_mm; not of the time
    bool breathes() const {
        return breathing_mm.x != 0 || breathing_mm.y != 0 || breathing_mm.z != 0;
    }
};

MotionState motion_at(const BreathingMotion& breathing, const Pulsation& pulsation, double time_s);

// How full veins are. Head down by some degrees, blood stands 200 mm sin(angle) higher in the neck;
// straining adds 20 mmHg (both assumed). Walls move out by vein_swell_mm times 1 - exp(-dP / 2.7
// mmHg), so that 10 and 15 degrees give the published gain in area (docs/procedures.md).
struct VeinState {
    double pressure_mmhg = 0;  // that makes them stiff
    double wall_mm = 0;        // outward shift of their walls beyond those of the case
};
VeinState vein_state(const Deformation& deformation, double head_down_deg, bool strains);

// Shape of one heart beat, phase in [0, 1): fast rise, slow fall, in [0, 1].
double pulse_wave(double phase);

// The weight on a coarse grid; trilinear in between, 0 outside.
class BreathingField {
  public:
    BreathingField() = default;
    explicit BreathingField(const CaseBundle& bundle);
    double weight(Point3 p) const;  // volume frame, mm
    bool empty() const { return cells_.empty(); }

  private:
    Grid grid_;
    std::vector<float> cells_;
};

}  // namespace sonocase
