// SPDX-License-Identifier: Apache-2.0

// How a pool of fluid moves the tissue around it: what lay where the fluid is now lies around it,
// as far out as its volume asks for.
//
//     rho^3 = r^3 - (1 - k^3) R^3 f(r)   beyond the pool's radius R
//     rho   = k r                        within it
//
// r is where tissue is, rho where it was, both from the pool's centre. Between R and 2.5 R nothing
// changes its volume; from there to 4 R, where tissue moves by less than R / 20, f falls from 1 to
// 0 and the shift fades. What was within k R does not move out: a picture shows fluid in its place,
// so that tissue moves by 1 - k^3, 94 %, of what was injected. The map is one to one.
// Source: incompressible flow from a point; docs/deformation.md. Constant time, no allocation.
#pragma once

#include <algorithm>
#include <cmath>
#include <span>

#include "formats/exercise/procedure.h"

namespace sonocase {

inline constexpr double kPoolCore = 0.4;                         // k
inline constexpr double kPoolFadesFrom = 2.5, kPoolReaches = 4;  // in radii
inline constexpr double kMinPoolMm = 0.4;                        // a smaller pool is none

// rho / r. The same bits everywhere: sums, products and quotients alone.
inline double pool_share(double r_mm, double radius_mm) {
    if (!(radius_mm >= kMinPoolMm)) return 1;
    const double radii = r_mm / radius_mm;
    if (!(radii < kPoolReaches)) return 1;
    if (radii <= 1) return kPoolCore;
    const double u = std::max(radii - kPoolFadesFrom, 0.0) * (1 / (kPoolReaches - kPoolFadesFrom));
    const double fades = 1 - u * u * (3 - 2 * u);
    const double kept =
        1 - (1 - kPoolCore * kPoolCore * kPoolCore) * fades / (radii * radii * radii);
    double root = kPoolCore + (1 - kPoolCore) * kept;  // cube root, by Halley's iteration
    for (int step = 0; step < 2; ++step) {             // from within 0.06 to 1e-11
        const double cube = root * root * root;
        root *= (cube + 2 * kept) / (2 * cube + kept);
    }
    return root;
}

// Where the tissue lay that pools have pushed to p; within a pool: its centre.
inline Point3 before_pools(std::span<const SceneChange::Pool> pools, Point3 p) {
    for (const SceneChange::Pool& pool : pools) {
        const Vector3 away = p - pool.centre;
        const double r_mm = norm(away);
        const bool within = r_mm <= pool.radius_mm && pool.radius_mm >= kMinPoolMm;
        p = pool.centre + (within ? 0 : pool_share(r_mm, pool.radius_mm)) * away;
    }
    return p;
}

}  // namespace sonocase
