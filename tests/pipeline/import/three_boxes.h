// SPDX-License-Identifier: Apache-2.0

// A body of three boxes, sampled along the RAS axes.
#pragma once

#include "formats/base/geometry.h"
#include "volume_files.h"

namespace sonocase::pipeline {

inline constexpr int kSpleen = 1, kKidneyRight = 2, kLiver = 5;

// Three boxes in RAS+ mm inside [0, 96] x [0, 64] x [0, 48], so unlike that no turning or flipping
// of the axes maps them onto themselves.
inline int body_at(Point3 p) {
    if (p.x < 8 || p.x > 84 || p.y < 6 || p.y > 58 || p.z < 4 || p.z > 44) return 0;
    if (p.x > 60 && p.y > 40) return kLiver;
    if (p.x < 30 && p.z < 20) return kSpleen;
    return kKidneyRight;
}

inline constexpr Vector3 kExtent{96, 64, 48}, kSpacing{2, 4, 3};
inline constexpr Point3 kCorner{-20, 15, 300};

inline int shifted_body(Point3 p) {
    return body_at(Point3{} + (p - kCorner));
}

inline testing::TinyVolume ras_volume() {
    return testing::sample_in_order({0, 1, 2}, {false, false, false}, kExtent, kSpacing, kCorner,
                                    shifted_body);
}
}  // namespace sonocase::pipeline
