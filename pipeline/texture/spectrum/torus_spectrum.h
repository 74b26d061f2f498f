// SPDX-License-Identifier: Apache-2.0

// The power spectrum of a square that wraps whose autocorrelation comes nearest to a given one.
#pragma once

#include <vector>

#include "pipeline/texture/spectrum/autocorrelation.h"

namespace sonocase::pipeline {

// An autocorrelation estimated from a finite patch is in general not that of any texture that wraps:
// cut off at half the period, its spectrum has negative values. This finds the nearest spectrum
// S >= 0:
//
//     minimise  0.3 |W (A S - whole)|^2 + 3 |W' (A G S - share * local)|^2,   S >= 0
//
// A      inverse Fourier transform, from spectrum to autocorrelation on the torus
// G      power gain of removing the local trend of standard deviation trend_vx; with it the grain
//        comes out right both with and without the shading of the patch
// W, W'  1 within the width of the grain, decreasing beyond, where an estimate is mostly noise
// share  variance of the local image over that of the whole image
//
// The problem is convex and solved by accelerated projected gradients (FISTA), `iterations` >= 1.
// Returns S, # edge^2, x fastest, of mean 1 (variance 1). Cost: 64 x 64, 200 iterations 50 ms.
std::vector<double> fit_torus_spectrum(const Autocorrelation& whole,
                                       const Autocorrelation& local,
                                       double share,
                                       double trend_vx,
                                       int edge,
                                       int iterations = 200);

}  // namespace sonocase::pipeline
