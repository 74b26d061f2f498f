// SPDX-License-Identifier: Apache-2.0

// Discrete Fourier transforms of rectangles and cubes whose edges are powers of two; the inverse is
// scaled by 1 / count, the forward transform is not scaled.
//
// These are not taken from a library: the order of the additions is part of the bytes of every
// texture, and a cube is transformed in place, many lines at once. They give the same bytes on any
// machine with IEEE arithmetic.
#pragma once

#include <complex>
#include <cstddef>
#include <vector>

namespace sonocase::pipeline::inline texture {

// # width * height, x fastest.
void fourier_plane(std::vector<std::complex<double>>& plane, int width, int height, bool inverse);
// # edge^3, x fastest. Cost: 64^3 8 ms, 128^3 90 ms on one core.
void fourier_cube(std::vector<std::complex<float>>& cube, int edge, bool inverse);

// Returns the index, in a square that wraps, of lag or wave (x, y); x, y in [-edge, edge).
inline std::size_t torus_index(int x, int y, int edge) {
    return (x + edge) % edge + static_cast<std::size_t>(edge) * ((y + edge) % edge);
}

}  // namespace sonocase::pipeline::inline texture
