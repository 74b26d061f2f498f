// SPDX-License-Identifier: Apache-2.0

#include "pipeline/segmentation/distance/marked_distance.h"

#include <algorithm>
#include <cmath>

#include "pipeline/base/parallel.h"

namespace sonocase::pipeline::inline segmentation_distance {
namespace {

constexpr float kFarSquared = kNoMark * kNoMark;

struct Envelope {
    std::vector<double> squares, starts;
    std::vector<int> roots;
};

// Replaces squared distances along one line by the minimum of (l - m)^2 + f(m).
void lower_envelope(float* line, std::size_t stride, int count, Envelope& e) {
    e.squares.resize(count);
    e.starts.resize(static_cast<std::size_t>(count) + 1);
    e.roots.resize(count);
    std::size_t used = 0;
    for (int q = 0; q < count; ++q) {
        const double f = static_cast<double>(line[static_cast<std::size_t>(q) * stride]);
        e.squares[q] = f;
        if (!(f < static_cast<double>(kFarSquared))) continue;
        double start = -1e30;
        while (used > 0) {
            const int r = e.roots[used - 1];
            start = (f + static_cast<double>(q) * q - e.squares[r] - static_cast<double>(r) * r) /
                    (2.0 * (q - r));
            if (start > e.starts[used - 1]) break;
            --used;
            start = -1e30;
        }
        e.roots[used] = q;
        e.starts[used++] = start;
    }
    if (used == 0) return;  // nothing marked on this line: stays far
    std::size_t at = 0;
    for (int l = 0; l < count; ++l) {
        while (at + 1 < used && e.starts[at + 1] < l) ++at;
        const double d = l - e.roots[at];
        line[static_cast<std::size_t>(l) * stride] =
            static_cast<float>(d * d + e.squares[e.roots[at]]);
    }
}

}  // namespace

std::vector<float> distance_to_marked(const std::vector<std::uint8_t>& marked, Int3 size) {
    std::vector<float> out(marked.size());
    const auto nx = static_cast<std::size_t>(size.x), ny = static_cast<std::size_t>(size.y),
               nz = static_cast<std::size_t>(size.z);
    parallel_for(nz, 1, [&](std::size_t begin, std::size_t end) {
        Envelope e;
        for (std::size_t k = begin; k < end; ++k) {
            float* plane = out.data() + k * nx * ny;
            for (std::size_t n = 0; n < nx * ny; ++n)
                plane[n] = marked[k * nx * ny + n] ? 0.0f : kFarSquared;
            for (std::size_t j = 0; j < ny; ++j) lower_envelope(plane + j * nx, 1, size.x, e);
            for (std::size_t i = 0; i < nx; ++i) lower_envelope(plane + i, nx, size.y, e);
        }
    });
    parallel_for(ny, 1, [&](std::size_t begin, std::size_t end) {
        Envelope e;
        for (std::size_t j = begin; j < end; ++j)
            for (std::size_t i = 0; i < nx; ++i)
                lower_envelope(out.data() + j * nx + i, nx * ny, size.z, e);
    });
    parallel_for(out.size(), 1 << 16, [&](std::size_t begin, std::size_t end) {
        for (std::size_t n = begin; n < end; ++n) out[n] = std::sqrt(out[n]);
    });
    return out;
}

}  // namespace sonocase::pipeline::inline segmentation_distance
