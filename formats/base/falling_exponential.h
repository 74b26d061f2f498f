// SPDX-License-Identifier: Apache-2.0

// The exponential where its bits must be the same on every platform, which libm's are not.
#pragma once

namespace sonocase {

// e^-q for q >= 0, relative error 3e-8; 0 beyond 60. Plain arithmetic: e^(-q/256) by its series,
// squared eight times.
inline double falling_exponential(double q) {
    if (!(q < 60)) return 0;
    const double x = -q / 256;
    double e = 1 + x * (1 + x / 2 * (1 + x / 3 * (1 + x / 4 * (1 + x / 5))));
    for (int i = 0; i < 8; ++i) e *= e;
    return e;
}

}  // namespace sonocase
