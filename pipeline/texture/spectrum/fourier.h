// SPDX-License-Identifier: Apache-2.0

// Discrete Fourier transforms of squares and cubes, edges a power of two, unscaled forward, inverse
// scaled by 1 / count. Same bytes on any machine with IEEE arithmetic.
#pragma once

#include <complex>
#include <vector>

namespace sonocase::pipeline {

// # width * height, x fastest.
void fourier_plane(std::vector<std::complex<double>>& plane, int width, int height, bool inverse);
// # edge^3, x fastest. Cost: 64^3 8 ms, 128^3 90 ms on one core.
void fourier_cube(std::vector<std::complex<float>>& cube, int edge, bool inverse);

}  // namespace sonocase::pipeline
