// SPDX-License-Identifier: Apache-2.0

// What the console of model `physical` calls 0 dB: gain and depth gain with which a sonographer
// would open the exercise. A thick wall takes 10 dB more from a picture than a thin one, and no
// fixed gain shows both.
//
// It is worked out once, from labels and targets alone. Planes: the exercise's own (the middle key
// of its script `needle`, or else up to eight that its scripts hold) with two thirds of the weight,
// and where it starts. Along beams of each, a sample's level is the echo of its tissue with the
// structure within it, less the attenuation above it, with the sheets of the wall and the haze
// below them; labels are looked up across the slab, so that a rib half in the plane takes its
// share. Bone, gas, fluid, targets and what lies in their shadow do not count.
//
// Depth gain brings levels kEvened of the way to one, like the eight sliders of a console, the
// organ of interest (formats/exercise/organ_of_interest.h) before other tissue, and a bright wall
// all the way. Gain brings the organ to kOpeningGrey, but all tissue not farther than 2 dB from
// there. So it is the same on every machine, for both renderers and for every attempt, whatever its
// pictures show later.
#pragma once

#include <array>

#include "formats/bundle/case_bundle.h"
#include "formats/exercise/exercise.h"
#include "runtime/imaging/physical/model/physical_scene.h"
#include "runtime/imaging/physical/model/physical_tables.h"

namespace sonocase::runtime::physical {

// Mean of the organ: some 10 grey over its middle where the map is a power, and its middle where it
// is a logarithm, which is as far above the dark half as below the bright one.
inline constexpr double kOpeningGrey = 106, kOpeningMiddle = 98;
inline constexpr double kEvened = 0.7;  // share of the difference between depths

// dB at eight depths, from the face to the picture's lower edge, linear in between.
struct OpeningGain {
    std::array<double, 8> db{};
    double at(double share) const;  // share of the depth, [0, 1]
};

// All 0 where the place of the exercise does not touch the body. Cost: 1 to 3 ms.
OpeningGain opening_gain(const PhysicalScene& scene,
                         const Exercise& exercise,
                         const Tables& tables,
                         const ScanGeometry& geometry);

}  // namespace sonocase::runtime::physical
