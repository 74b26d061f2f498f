// SPDX-License-Identifier: Apache-2.0

#include "pipeline/registration/elastic/natural_log.h"

#include <cmath>

namespace sonocase::pipeline {

double natural_log(double x) {
    int exponent = 0;
    double m = std::frexp(x, &exponent);  // exact
    if (m < 0.70710678118654752) {
        m *= 2;
        --exponent;
    }
    // log m = 2 artanh s with |s| <= 0.172: the next term is below 1e-17.
    const double s = (m - 1) / (m + 1), t = s * s;
    double sum = 1.0 / 21;
    for (int n = 19; n >= 3; n -= 2) sum = sum * t + 1.0 / n;
    return exponent * 0.69314718055994531 + 2 * s * (1 + t * sum);
}

}  // namespace sonocase::pipeline
