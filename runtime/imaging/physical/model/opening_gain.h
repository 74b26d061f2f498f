// SPDX-License-Identifier: Apache-2.0

// What the console of model `physical` calls 0 dB: gain and depth gain with which a sonographer
// would open the exercise. A thick wall takes 10 dB more from a picture than a thin one, and no
// fixed gain shows both.
//
// It is worked out once, from labels and targets alone: along some beams, two of three at the
// exercise's own place (the middle key of its script `needle`, or else five keys all along its
// first script) and one of three at its start, each tissue's echo less the attenuation above it
// gives a level for each depth. Depth gain brings levels kEvened of the way to one, like the eight
// sliders of a console, and gain brings their mean to kOpeningGrey. Bone, gas, fluid, targets and
// what lies in their shadow do not count. So it is the same on every machine, for both renderers
// and for every attempt, whatever its pictures show later.
#pragma once

#include <array>

#include "formats/bundle/case_bundle.h"
#include "formats/exercise/exercise.h"
#include "runtime/imaging/physical/model/physical_scene.h"
#include "runtime/imaging/physical/model/physical_tables.h"

namespace sonocase::runtime::physical {

inline constexpr double kOpeningGrey = 98;  // of organs, mean
inline constexpr double kEvened = 0.7;      // share of the difference between depths

// dB at eight depths, from the face to the picture's lower edge, linear in between.
struct OpeningGain {
    std::array<double, 8> db{};
    double at(double share) const;  // share of the depth, [0, 1]
};

// All 0 where the place of the exercise does not touch the body. Cost: 1 ms.
OpeningGain opening_gain(const PhysicalScene& scene,
                         const Exercise& exercise,
                         const Tables& tables,
                         const ScanGeometry& geometry);

}  // namespace sonocase::runtime::physical
