// SPDX-License-Identifier: Apache-2.0

// The part of the scan plane that a probe shows, and how much of a straight needle lies in it.
#pragma once

#include "formats/base/geometry.h"
#include "formats/exercise/exercise.h"

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
// Its length.
double length_in_image(const Probe& probe, Point3 a, Point3 b, double half_slab_mm);

}  // namespace sonocase
