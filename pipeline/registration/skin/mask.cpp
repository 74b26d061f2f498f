// SPDX-License-Identifier: Apache-2.0

#include "pipeline/registration/skin/mask.h"

#include <algorithm>

#include "pipeline/base/parallel.h"

namespace sonocase::pipeline {

void fill_holes(Slice slice) {
    std::vector<int> stack;
    Mask outside(slice.count(), 0);
    const auto push = [&](int i, int j) {
        const int n = i + slice.width * j;
        if (slice.at[n] || outside[static_cast<std::size_t>(n)]) return;
        outside[static_cast<std::size_t>(n)] = 1;
        stack.push_back(n);
    };
    for (int i = 0; i < slice.width; ++i) push(i, 0), push(i, slice.height - 1);
    for (int j = 0; j < slice.height; ++j) push(0, j), push(slice.width - 1, j);
    while (!stack.empty()) {
        const int n = stack.back();
        stack.pop_back();
        const int i = n % slice.width, j = n / slice.width;
        if (i > 0) push(i - 1, j);
        if (i + 1 < slice.width) push(i + 1, j);
        if (j > 0) push(i, j - 1);
        if (j + 1 < slice.height) push(i, j + 1);
    }
    for (std::size_t n = 0; n < slice.count(); ++n) {
        if (!outside[n]) slice.at[n] = 1;
    }
}

Disc disc(double radius_x, double radius_y) {
    Disc offsets;
    const int nx = static_cast<int>(radius_x), ny = static_cast<int>(radius_y);
    for (int j = -ny; j <= ny; ++j) {
        for (int i = -nx; i <= nx; ++i) {
            const double x = radius_x > 0 ? i / radius_x : 0, y = radius_y > 0 ? j / radius_y : 0;
            if (x * x + y * y <= 1 + 1e-9) offsets.push_back({i, j});
        }
    }
    return offsets;
}

Mask eroded(Slice slice, const Disc& offsets) {
    Mask out(slice.count(), 0);
    for (int j = 0; j < slice.height; ++j) {
        for (int i = 0; i < slice.width; ++i) {
            if (!slice.at[i + slice.width * j]) continue;
            bool keep = true;
            for (const auto& o : offsets) {
                const int x = i + o[0], y = j + o[1];
                if (x < 0 || y < 0 || x >= slice.width || y >= slice.height) continue;
                if (!slice.at[x + slice.width * y]) {
                    keep = false;
                    break;
                }
            }
            out[static_cast<std::size_t>(i + slice.width * j)] = keep;
        }
    }
    return out;
}

std::int32_t Parts::largest() const {
    std::int32_t best = 0;
    for (std::size_t n = 1; n < size.size(); ++n) {
        if (best == 0 || size[n] > size[static_cast<std::size_t>(best)]) {
            best = static_cast<std::int32_t>(n);
        }
    }
    return best;
}

Parts parts_of(const std::uint8_t* mask, Int3 size) {
    Parts parts;
    const int row = size.x, slice = size.x * size.y, total = slice * size.z;
    parts.number.assign(static_cast<std::size_t>(total), 0);
    std::vector<int> stack;
    for (int seed = 0; seed < total; ++seed) {
        if (!mask[seed] || parts.number[static_cast<std::size_t>(seed)]) continue;
        const auto label = static_cast<std::int32_t>(parts.size.size());
        long count = 0;
        parts.number[static_cast<std::size_t>(seed)] = label;
        stack.push_back(seed);
        while (!stack.empty()) {
            const int n = stack.back();
            stack.pop_back();
            ++count;
            const int i = n % row, j = n % slice / row, k = n / slice;
            const auto visit = [&](bool there, int m) {
                if (!there || !mask[m] || parts.number[static_cast<std::size_t>(m)]) return;
                parts.number[static_cast<std::size_t>(m)] = label;
                stack.push_back(m);
            };
            visit(i > 0, n - 1);
            visit(i + 1 < size.x, n + 1);
            visit(j > 0, n - row);
            visit(j + 1 < size.y, n + row);
            visit(k > 0, n - slice);
            visit(k + 1 < size.z, n + slice);
        }
        parts.size.push_back(count);
    }
    return parts;
}

void restore_edge(Mask& seed, const Mask& mask, Int3 size, const Disc& offsets) {
    const std::size_t count = static_cast<std::size_t>(size.x) * static_cast<std::size_t>(size.y);
    parallel_for(static_cast<std::size_t>(size.z), 4, [&](std::size_t begin, std::size_t end) {
        Mask grown(count);
        for (std::size_t k = begin; k < end; ++k) {
            std::fill(grown.begin(), grown.end(), std::uint8_t{0});
            std::uint8_t* s = seed.data() + k * count;
            const std::uint8_t* m = mask.data() + k * count;
            for (int j = 0; j < size.y; ++j) {
                for (int i = 0; i < size.x; ++i) {
                    if (!s[i + size.x * j]) continue;
                    for (const auto& o : offsets) {
                        const int x = i + o[0], y = j + o[1];
                        if (x >= 0 && y >= 0 && x < size.x && y < size.y) {
                            grown[static_cast<std::size_t>(x + size.x * y)] = 1;
                        }
                    }
                }
            }
            for (std::size_t n = 0; n < count; ++n) s[n] = grown[n] && m[n];
        }
    });
}

std::vector<long> plane_counts(const Mask& mask, Int3 size, int axis) {
    std::vector<long> counts(static_cast<std::size_t>(size[axis]), 0);
    std::size_t n = 0;
    for (int k = 0; k < size.z; ++k) {
        for (int j = 0; j < size.y; ++j) {
            for (int i = 0; i < size.x; ++i, ++n) {
                if (mask[n]) ++counts[static_cast<std::size_t>(axis == 0 ? i : axis == 1 ? j : k)];
            }
        }
    }
    return counts;
}

}  // namespace sonocase::pipeline
