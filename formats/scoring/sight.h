// SPDX-License-Identifier: Apache-2.0

// What the sound reaches: a point behind a rib, behind gas or under a part of the probe's face that
// is in the air is in the image and yet cannot be seen.
#pragma once

#include "formats/exercise/exercise.h"
#include "formats/scoring/anatomy.h"

namespace sonocase {

inline constexpr double kSightStepMm = 1;   // between the points of a ray that are looked up
inline constexpr double kCoupledAirMm = 4;  // of air that gel bridges
inline constexpr double kSightShaftMm = 2;  // between the points of a shaft that are tried

// True if the scanline through the point meets neither bone nor gas before it, and no more than
// kCoupledAirMm of air. Tissue is taken where breathing has moved it. The scanline starts at the
// probe's face, runs through the foot of the point in the scan plane and is continued at the
// point's own distance to the plane. Always true where the anatomy does not know its tissues.
//
// mannequin_from_probe  pose of the probe
// p_probe               the point, `probe` frame
// Cost: one look-up per millimetre of depth, no allocation.
bool sound_reaches(const Anatomy& anatomy,
                   const Probe& probe,
                   const Rigid& mannequin_from_probe,
                   Point3 p_probe,
                   double time_s);

// Length of the segment a-b (`probe` frame) that is in the image (image_region.h) and reached by
// sound; of the latter every kSightShaftMm is tried.
double visible_length(const Anatomy& anatomy,
                      const Probe& probe,
                      const Rigid& mannequin_from_probe,
                      Point3 a,
                      Point3 b,
                      double half_slab_mm,
                      double time_s);

}  // namespace sonocase
