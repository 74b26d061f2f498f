// SPDX-License-Identifier: Apache-2.0

#include "runtime/imaging/physical/model/lobule_walls.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "runtime/imaging/physical/model/cell_hash.h"

namespace sonocase::runtime::physical {
namespace {

constexpr double kMostMm = 5;  // of a wall, from the middle of its seeds and along it
constexpr double kLeastMm = 1;
constexpr double kShiftMm =
    2;  // by which walls are off the middle of their seeds, at most; few are further

constexpr std::size_t kOwn = 13, kSeeds = 27;
constexpr double kUp = kLobuleFlat * kLobuleFlat - 1;

// Seeds of a cell and its neighbours, and how far they are apart.
struct Seeds {
    std::array<Point3, kSeeds> at;
    std::array<std::uint32_t, kSeeds> draw{};
    Vector3 skin;

    Vector3 stretched(Vector3 v) const { return v + kUp * dot(v, skin) * skin; }

    // Where the line from `from` along `to` (unit) lies nearer to the own seed than to any third
    // one, within kMostMm. False: nowhere.
    bool clip(std::size_t other, Point3 from, Vector3 to, double& begin, double& end) const {
        begin = -kMostMm;
        end = kMostMm;
        for (std::size_t m = 0; m < kSeeds; ++m) {
            if (m == kOwn || m == other) continue;
            // Nearer to the own seed: (from + t to - middle) . normal < 0.
            const Vector3 apart = at[m] - at[kOwn], normal = stretched(apart);
            const double past = dot(from - (at[kOwn] + 0.5 * apart), normal),
                         slope = dot(to, normal);
            if (slope > 1e-9) {
                end = std::min(end, -past / slope);
            } else if (slope < -1e-9) {
                begin = std::max(begin, -past / slope);
            } else if (past > 0) {
                return false;
            }
            if (!(begin < end)) return false;
        }
        return true;
    }
};

Seeds seeds_around(Int3 cell, double cell_mm, Point3 corner, Vector3 skin) {
    Seeds seeds{{}, {}, skin};
    for (std::size_t n = 0; n < kSeeds; ++n) {
        const int i = cell.x + static_cast<int>(n % 3) - 1,
                  j = cell.y + static_cast<int>(n / 3 % 3) - 1,
                  k = cell.z + static_cast<int>(n / 9) - 1;
        const std::uint32_t h = hash32(hash_of_cell(i, j, k) + 977);
        const auto part = [&](int shift) { return (h >> shift & 0x3FF) / 1024.0; };
        seeds.draw[n] = h;
        seeds.at[n] = corner + cell_mm * Vector3{i + part(0), j + part(10), k + part(20)};
    }
    return seeds;
}

}  // namespace

int find_lobule_walls(Int3 cell,
                      double cell_mm,
                      Point3 corner,
                      const LobuleView& view,
                      std::span<LobuleWall, kMostLobuleWalls> out) {
    // A wall's middle is no further from the cell's own than this.
    const double reach_mm = view.reach_mm + kShiftMm;
    if (std::abs(view.off_mm) > reach_mm + 1.5 * cell_mm) return 0;
    const Vector3 skin = view.skin;
    const Seeds seeds = seeds_around(cell, cell_mm, corner, skin);
    const Point3 centre = corner + cell_mm * Vector3{cell.x + 0.5, cell.y + 0.5, cell.z + 0.5};
    const double least = 1 - view.most_sin * view.most_sin;
    int found = 0;
    for (std::size_t n = kOwn + 1; n < kSeeds; ++n) {
        const Vector3 apart = seeds.at[n] - seeds.at[kOwn], normal = seeds.stretched(apart);
        const double facing = dot(normal, view.beam), size = dot(normal, normal);
        if (!(facing * facing > least * size)) continue;
        Point3 middle = seeds.at[kOwn] + 0.5 * apart;
        if (std::abs(view.off_mm + dot(middle - centre, view.across)) > reach_mm) continue;
        // The wall's middle, first along the skin, then at right angles to that.
        Vector3 along = cross(normal, skin);
        if (dot(along, along) < 1e-6 * size)
            along = cross(normal, std::abs(normal.x) < std::abs(normal.y) ? Vector3{1, 0, 0}
                                                                          : Vector3{0, 1, 0});
        along = normalized(along);
        const Vector3 across = normalized(cross(normal, along));
        double begin = 0, end = 0, length = 0;
        if (!seeds.clip(n, middle, along, begin, end)) continue;
        middle = middle + 0.5 * (begin + end) * along;
        length = end - begin;
        if (!seeds.clip(n, middle, across, begin, end)) continue;
        middle = middle + 0.5 * (begin + end) * across;
        length = std::sqrt(length * (end - begin));
        if (length < kLeastMm) continue;
        out[static_cast<std::size_t>(found++)] = {middle, normal, length,
                                                  hash32(seeds.draw[kOwn] ^ seeds.draw[n])};
    }
    return found;
}

}  // namespace sonocase::runtime::physical
