// SPDX-License-Identifier: Apache-2.0

// The part of the scan plane that a probe shows, how much of a straight needle lies in it, and what
// sound reaches: a point behind a rib, behind gas or under a part of the face that is in the air is
// in the image and yet cannot be seen.
#pragma once

#include "formats/base/geometry.h"
#include "formats/exercise/exercise.h"
#include "formats/scoring/anatomy.h"

namespace sonocase {

// Scan plane: x lateral, z depth, mm, origin at the middle of the probe face (x and z of the
// `probe` frame).
//     linear       |x| <= width / 2, 0 <= z <= depth
//     curvilinear  polar about (0, -radius): radius <= r <= radius + depth, |angle| <= field of
//                  view / 2
//     phased       the same with radius 0
bool in_image(const Probe& probe, double x, double z);

// Distance from (x, z) to that region; 0 inside.
double distance_to_image(const Probe& probe, double x, double z);

// The part of a segment that lies in the image, as fractions of the way from its first point to its
// last; low >= high: none.
struct ImageInterval {
    double low = 0, high = 0;
    double share() const { return high > low ? high - low : 0; }
};

// Part of the segment a-b (`probe` frame) that lies in the image: within half_slab_mm of the scan
// plane and inside the region; the hollow between a curved face and its chord counts as inside.
// Exact: clipping by planes and a circle leaves one interval of the segment.
ImageInterval interval_in_image(const Probe& probe, Point3 a, Point3 b, double half_slab_mm);
// The length of that part.
double length_in_image(const Probe& probe, Point3 a, Point3 b, double half_slab_mm);

inline constexpr double kSightStepMm = 1;   // spacing of the tested points of a ray
inline constexpr double kCoupledAirMm = 4;  // thickness of air that gel fills
inline constexpr double kSightShaftMm = 2;  // spacing of the tested points of a shaft

// True if the scan line through the point meets neither bone nor gas before it, and at most
// kCoupledAirMm of air. Tissue counts where breathing has moved it. A point off the scan plane has
// the scan line of its projection on the plane, shifted by its distance to the plane. Always true
// where the anatomy does not know its tissues.
//
// mannequin_from_probe  pose of the probe
// p_probe               the point, `probe` frame
// Cost: one look-up per millimetre of depth, no allocation.
bool sound_reaches(const Anatomy& anatomy,
                   const Probe& probe,
                   const Rigid& mannequin_from_probe,
                   Point3 p_probe,
                   double time_s);

// Length of the segment a-b (`probe` frame) that is in the image and reached by sound, which is
// tested every kSightShaftMm.
double visible_length(const Anatomy& anatomy,
                      const Probe& probe,
                      const Rigid& mannequin_from_probe,
                      Point3 a,
                      Point3 b,
                      double half_slab_mm,
                      double time_s);

}  // namespace sonocase
