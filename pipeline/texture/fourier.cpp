// SPDX-License-Identifier: Apache-2.0

#include "pipeline/texture/fourier.h"

#include <algorithm>
#include <cmath>
#include <cstddef>

namespace sonocase::pipeline::inline texture {
namespace {

// Radix-2 Stockham transform of `lines` interleaved lines at once: element i of line k is at
// data[i * lines + k]. Interleaved lines make the innermost loop long and free of shuffles, and the
// y and z axes of a cube already have this layout.
template <class T>
class Fourier {
  public:
    Fourier(int n, bool inverse) : n_(n) {
        const double sign = inverse ? 1 : -1;
        for (int i = 0; i < n / 2; ++i) {
            const double angle = sign * 6.283185307179586476925 * i / n;
            twiddle_.emplace_back(static_cast<T>(std::cos(angle)), static_cast<T>(std::sin(angle)));
        }
    }

    // Transforms in place; `scratch` has the size of `data`.
    void run(std::complex<T>* data, std::complex<T>* scratch, std::size_t lines) const {
        std::complex<T>* from = data;
        std::complex<T>* to = scratch;
        std::size_t stride = lines;
        for (int n = n_; n > 1; n /= 2) {
            const int half = n / 2;
            const int step = n_ / n;
            for (int p = 0; p < half; ++p) {
                const T wr = twiddle_[p * step].real();
                const T wi = twiddle_[p * step].imag();
                const T* a = reinterpret_cast<const T*>(from + stride * p);
                const T* b = reinterpret_cast<const T*>(from + stride * (p + half));
                T* s = reinterpret_cast<T*>(to + stride * (2 * p));
                T* d = reinterpret_cast<T*>(to + stride * (2 * p + 1));
                for (std::size_t q = 0; q < 2 * stride; q += 2) {
                    const T ar = a[q], ai = a[q + 1], br = b[q], bi = b[q + 1];
                    s[q] = ar + br;
                    s[q + 1] = ai + bi;
                    const T er = ar - br, ei = ai - bi;
                    d[q] = er * wr - ei * wi;
                    d[q + 1] = er * wi + ei * wr;
                }
            }
            std::swap(from, to);
            stride *= 2;
        }
        if (from != data) std::copy(from, from + lines * n_, data);
    }

  private:
    int n_;
    std::vector<std::complex<T>> twiddle_;
};

template <class T>
void along_rows(std::vector<std::complex<T>>& data, int n, const Fourier<T>& fourier) {
    std::vector<std::complex<T>> scratch(n);
    for (std::size_t row = 0; row < data.size(); row += n) {
        fourier.run(data.data() + row, scratch.data(), 1);
    }
}

template <class T>
void scale(std::vector<std::complex<T>>& data) {
    const T factor = T(1) / static_cast<T>(data.size());
    for (std::complex<T>& value : data) value *= factor;
}

}  // namespace

void fourier_plane(std::vector<std::complex<double>>& plane, int width, int height, bool inverse) {
    along_rows(plane, width, Fourier<double>(width, inverse));
    std::vector<std::complex<double>> scratch(plane.size());
    Fourier<double>(height, inverse).run(plane.data(), scratch.data(), width);
    if (inverse) scale(plane);
}

void fourier_cube(std::vector<std::complex<float>>& cube, int edge, bool inverse) {
    const Fourier<float> fourier(edge, inverse);
    const std::size_t n = edge;
    along_rows(cube, edge, fourier);
    std::vector<std::complex<float>> scratch(n * n);
    for (std::size_t z = 0; z < n; ++z) fourier.run(cube.data() + z * n * n, scratch.data(), n);
    // Along z, plane by plane at fixed y; each plane is copied, which keeps it in the cache.
    std::vector<std::complex<float>> plane(n * n);
    for (std::size_t y = 0; y < n; ++y) {
        for (std::size_t z = 0; z < n; ++z) {
            std::copy_n(cube.data() + n * (y + n * z), n, plane.data() + n * z);
        }
        fourier.run(plane.data(), scratch.data(), n);
        for (std::size_t z = 0; z < n; ++z) {
            std::copy_n(plane.data() + n * z, n, cube.data() + n * (y + n * z));
        }
    }
    if (inverse) scale(cube);
}

}  // namespace sonocase::pipeline::inline texture
