// SPDX-License-Identifier: Apache-2.0

// How the mannequin goes on beyond the last readings: a quadratic height over the plane of each
// reading at the rim of a sweep, fitted to its neighbours. Without it the skin beside the rim
// follows its own shape and runs off the mannequin's.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "pipeline/registration/matching/target_surface.h"

namespace sonocase::pipeline {

class RimPatches {
  public:
    static constexpr double kReach_mm = 30;  // beside the reading

    // One patch for each of `readings` that is at the rim and no lift-off. Cost: 5 us each.
    RimPatches(const TargetSurface& target, std::span<const std::uint32_t> readings);

    struct Foot {
        bool found = false;
        double gap_mm = 0;  // signed distance of the point from the patch, first order
        Vector3 normal;     // of the patch there
    };
    // The place on the patch of reading `reading` below or above a point, mannequin frame relative
    // to the target's origin.
    Foot foot(std::uint32_t reading, Point3 p) const;

  private:
    struct Patch {
        Vector3 u, v;      // in the plane; its normal is that of the reading
        double c[6] = {};  // height = c0 + c1 a + c2 b + c3 aa + c4 ab + c5 bb
        bool good = false;
    };
    const TargetSurface& target_;
    std::vector<std::int32_t> patch_of_;  // # target points; -1: none
    std::vector<Patch> patches_;
};

}  // namespace sonocase::pipeline
