// SPDX-License-Identifier: Apache-2.0

// The natural logarithm with the same bits on every platform; libm's differ.
#pragma once

namespace sonocase::pipeline {

// x > 0, finite, not subnormal. Relative error below 4e-16 away from 1, absolute below 1e-16 near
// it.
double natural_log(double x);

}  // namespace sonocase::pipeline
