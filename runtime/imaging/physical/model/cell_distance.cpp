// SPDX-License-Identifier: Apache-2.0

#include "runtime/imaging/physical/model/cell_distance.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>

#include "runtime/imaging/physical/model/tissue_layers.h"

namespace sonocase::runtime {
namespace {

// Solves |grad u| = 1 (Godunov's upwind scheme) for one cell from its smallest neighbours.
float upwind(float a, float b, float c, float h) {
    if (a > b) std::swap(a, b);
    if (b > c) std::swap(b, c);
    if (a > b) std::swap(a, b);
    float u = a + h;
    if (u <= b) return u;
    u = 0.5f * (a + b + std::sqrt(std::max(2 * h * h - (a - b) * (a - b), 0.0f)));
    if (u <= c) return u;
    const float s = a + b + c;
    return (s + std::sqrt(std::max(s * s - 3 * (a * a + b * b + c * c - h * h), 0.0f))) / 3;
}

// Fast sweeping (Zhao 2005): eight orders of the cells, each of which follows the characteristics
// of one octant. Cells that are not open keep their value.
void march(const Cells& c, const std::vector<std::uint8_t>& open, CellField& u) {
    const auto h = static_cast<float>(c.mm);
    constexpr auto kFar = static_cast<float>(kLayerFarMm);
    const std::ptrdiff_t sy = c.stride(1), sz = c.stride(2);
    const CellField beyond(static_cast<std::size_t>(c.size.x),
                           kFar);  // a row outside of the volume
    // Of each row, where the open cells begin and end.
    std::vector<std::array<int, 2>> open_in(static_cast<std::size_t>(c.size.y * c.size.z));
    for (std::size_t row = 0; row < open_in.size(); ++row) {
        const std::uint8_t* p = open.data() + row * static_cast<std::size_t>(c.size.x);
        int begin = 0, end = c.size.x;
        while (begin < end && !p[begin]) ++begin;
        while (end > begin && !p[end - 1]) --end;
        open_in[row] = {begin, end};
    }
    bool changed = true;  // an order that changes nothing leaves nothing for those after it
    for (int order = 0; order < 8 && changed; ++order) {
        changed = false;
        const auto index = [&](int i, int axis) {
            return order >> axis & 1 ? c.size[axis] - 1 - i : i;
        };
        for (int k0 = 0; k0 < c.size.z; ++k0) {
            const int k = index(k0, 2);
            for (int j0 = 0; j0 < c.size.y; ++j0) {
                const int j = index(j0, 1);
                const auto [begin, end] = open_in[static_cast<std::size_t>(k * c.size.y + j)];
                const std::ptrdiff_t first = j * sy + k * sz;
                float* row = u.data() + first;
                const std::uint8_t* open_row = open.data() + first;
                const float *before_y = j > 0 ? row - sy : beyond.data(),
                            *after_y = j < c.size.y - 1 ? row + sy : beyond.data(),
                            *before_z = k > 0 ? row - sz : beyond.data(),
                            *after_z = k < c.size.z - 1 ? row + sz : beyond.data();
                for (int n = 0; n < end - begin; ++n) {
                    const int i = order & 1 ? end - 1 - n : begin + n;
                    if (!open_row[i]) continue;
                    const float x =
                        std::min(i > 0 ? row[i - 1] : kFar, i < c.size.x - 1 ? row[i + 1] : kFar);
                    const float y = std::min(before_y[i], after_y[i]);
                    const float z = std::min(before_z[i], after_z[i]);
                    // A front that comes from farther away does not bring the cell nearer.
                    if (std::min({x, y, z}) >= row[i]) continue;
                    const float nearer = upwind(x, y, z, h);
                    if (nearer >= row[i]) continue;
                    row[i] = nearer;
                    changed = true;
                }
            }
        }
    }
}

// The share is all or nothing, and that of the neighbours too.
bool is_flat(const Cells& c, const CellField& share, std::size_t at, Int3 cell) {
    const float* p = share.data() + at;
    if (*p != 0 && *p != 1) return false;
    for (int axis = 0; axis < 3; ++axis) {
        const std::ptrdiff_t step = c.stride(axis);
        if (cell[axis] > 0 && p[-step] != *p) return false;
        if (cell[axis] + 1 < c.size[axis] && p[step] != *p) return false;
    }
    return true;
}

}  // namespace

void smooth_cells(const Cells& c, CellField& f) {
    const auto width = static_cast<std::size_t>(c.size.x);
    const auto mean = [](float a, float b, float c3) { return (a + b + c3) * (1 / 3.0f); };
    CellField before(width), here(width);  // a row as it was
    for (std::size_t row = 0; row < f.size(); row += width) {
        float* p = f.data() + row;
        std::copy(p, p + width, here.begin());
        for (std::size_t i = 0; i < width; ++i)
            p[i] = mean(here[i > 0 ? i - 1 : 0], here[i], here[std::min(i + 1, width - 1)]);
    }
    // Row by row along y, then along z: each needs the one before it as it was.
    for (const int axis : {1, 2}) {
        const int lines = axis == 1 ? c.size.z : c.size.y;
        for (int line = 0; line < lines; ++line) {
            float* p = f.data() + line * c.stride(3 - axis);
            for (int n = 0; n < c.size[axis]; ++n, p += c.stride(axis)) {
                const float* after = n + 1 < c.size[axis] ? p + c.stride(axis) : p;
                std::copy(p, p + width, here.begin());
                if (n == 0) before = here;
                for (std::size_t i = 0; i < width; ++i) p[i] = mean(before[i], here[i], after[i]);
                std::swap(before, here);
            }
        }
    }
}

CellField distance_into(const Cells& c, const CellField& share, const CellField* wanted) {
    CellField u(share.size());
    std::vector<std::uint8_t> open(share.size(), 0);
    constexpr auto kFar = static_cast<float>(kLayerFarMm), kBand = static_cast<float>(kLayerBandMm);
    const auto mm = static_cast<float>(c.mm);
    std::size_t at = 0;
    for (int k = 0; k < c.size.z; ++k) {
        for (int j = 0; j < c.size.y; ++j) {
            for (int i = 0; i < c.size.x; ++i, ++at) {
                const float s = share[at];
                u[at] = s >= 0.5f ? kFar : -kBand;
                if (is_flat(c, share, at, {i, j, k})) {  // most cells: far from the surface
                    open[at] = s >= 0.5f && (wanted == nullptr || (*wanted)[at] > 0.05f);
                    continue;
                }
                const auto slope = [&](int n, int axis) {
                    const int last = c.size[axis] - 1;
                    const float* p = share.data() + at;
                    const std::ptrdiff_t step = c.stride(axis);
                    return (p[n < last ? step : 0] - p[n > 0 ? -step : 0]) /
                           (mm * static_cast<float>((n < last) + (n > 0) > 0 ? (n < last) + (n > 0)
                                                                             : 1));
                };
                const float gx = slope(i, 0), gy = slope(j, 1), gz = slope(k, 2);
                const float steep = std::sqrt(gx * gx + gy * gy + gz * gz);
                const float level = (s - 0.5f) / std::max(steep, 1e-6f);
                if (std::abs(level) < mm) {
                    u[at] = level;  // near the surface the share itself is the distance
                } else if (s >= 0.5f) {
                    open[at] = wanted == nullptr || (*wanted)[at] > 0.05f;
                } else {
                    u[at] = std::max(level, -kBand);
                }
            }
        }
    }
    march(c, open, u);
    smooth_cells(c, u);
    return u;
}

}  // namespace sonocase::runtime
