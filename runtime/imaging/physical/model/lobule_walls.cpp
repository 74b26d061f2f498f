// SPDX-License-Identifier: Apache-2.0

#include "runtime/imaging/physical/model/lobule_walls.h"

#include <algorithm>
#include <array>
#include <cmath>

namespace sonocase::runtime::physical {
namespace {

constexpr double kMaxMm = 5;    // half extent of a wall, from the middle of its seeds
constexpr double kMinMm = 1;    // smaller walls are left out
constexpr double kShiftMm = 2;  // walls are this far off the middle of their seeds; few are further

// The other cells: those that share a face, an edge or a corner with the cell, first those whose
// walls most often end a line. Padded.
constexpr std::size_t kOthers = 26, kLanes = 4, kPlanes = 28;
constexpr std::array<std::uint8_t, kOthers> kPlace{4,  10, 12, 14, 16, 22, 1, 3, 5, 7,  9,  11, 15,
                                                   17, 19, 21, 23, 25, 0,  2, 6, 8, 18, 20, 24, 26};
// Which of them is at a place, 9 z + 3 y + x.
constexpr std::array<std::uint8_t, 27> kOther = [] {
    std::array<std::uint8_t, 27> out{};
    for (std::size_t m = 0; m < kOthers; ++m) out[kPlace[m]] = static_cast<std::uint8_t>(m);
    return out;
}();
constexpr int kOwn = 13;  // place of the cell itself
constexpr double kUp = kLobuleFlat * kLobuleFlat - 1;

struct Seed {
    Point3 at;
    std::uint32_t draw;
};

// Seeds around a cell: the beginnings of their cells' hashes, by the step along each axis.
struct Seeds {
    Int3 cell;
    double cell_mm;
    Point3 corner;
    std::array<std::uint32_t, 3> x, y, z;

    Seeds(Int3 own, double edge_mm, Point3 corner_mm)
        : cell(own), cell_mm(edge_mm), corner(corner_mm) {
        for (std::size_t n = 0; n < 3; ++n) {
            const auto step = static_cast<std::uint32_t>(n) - 1;
            x[n] = (static_cast<std::uint32_t>(cell.x) + step) * kHashX;
            y[n] = (static_cast<std::uint32_t>(cell.y) + step) * kHashY;
            z[n] = (static_cast<std::uint32_t>(cell.z) + step) * kHashZ;
        }
    }
    Seed at(int place) const {
        const int i = place % 3, j = place / 3 % 3, k = place / 9;
        const std::uint32_t of_cell = hash32(x[i] ^ y[j] ^ z[k]);
        const std::uint32_t h = hash32(of_cell + 977);
        const auto part = [&](int shift) { return (h >> shift & 0x3FF) / 1024.0; };
        return {corner + cell_mm * Vector3{cell.x + i - 1 + part(0), cell.y + j - 1 + part(10),
                                           cell.z + k - 1 + part(20)},
                h};
    }
};

// The planes halfway between a cell's own seed and the others, in the order of kPlace. A normal of
// zero bounds nothing.
struct Planes {
    std::array<double, kPlanes> x, y, z;     // a place on the plane
    std::array<double, kPlanes> nx, ny, nz;  // normal
    std::array<std::uint32_t, kOthers> draw;
    std::array<std::uint8_t, kPlanes> meets;  // the view may show it

    Planes(const Seeds& seeds,
           const Seed& own,
           const LobuleView& view,
           Point3 centre,
           double reach_mm) {
        for (std::size_t m = 0; m < kOthers; ++m) {
            const Seed other = seeds.at(kPlace[m]);
            draw[m] = other.draw;
            x[m] = other.at.x;
            y[m] = other.at.y;
            z[m] = other.at.z;
        }
        for (std::size_t m = kOthers; m < kPlanes; ++m) {
            x[m] = own.at.x;
            y[m] = own.at.y;
            z[m] = own.at.z;
        }
        const double min_cos2 = 1 - view.max_sin * view.max_sin;
        for (std::size_t m = 0; m < kPlanes; ++m) {
            const double ax = x[m] - own.at.x, ay = y[m] - own.at.y, az = z[m] - own.at.z;
            const double up = kUp * (ax * view.skin.x + ay * view.skin.y + az * view.skin.z);
            nx[m] = ax + up * view.skin.x;
            ny[m] = ay + up * view.skin.y;
            nz[m] = az + up * view.skin.z;
            x[m] = own.at.x + 0.5 * ax;
            y[m] = own.at.y + 0.5 * ay;
            z[m] = own.at.z + 0.5 * az;
            const double facing = nx[m] * view.beam.x + ny[m] * view.beam.y + nz[m] * view.beam.z,
                         size = nx[m] * nx[m] + ny[m] * ny[m] + nz[m] * nz[m];
            const double off = view.off_mm + ((x[m] - centre.x) * view.across.x +
                                              (y[m] - centre.y) * view.across.y +
                                              (z[m] - centre.z) * view.across.z);
            meets[m] = static_cast<std::uint8_t>((facing * facing > min_cos2 * size) &
                                                 (std::abs(off) <= reach_mm));
        }
    }
    void set_normal(std::size_t m, Vector3 normal) {
        nx[m] = normal.x;
        ny[m] = normal.y;
        nz[m] = normal.z;
    }

    // Finds where the line from `from` along `to` (unit) lies on the own seed's side of all planes,
    // within kMaxMm. False: nowhere, which the nearest planes mostly decide. It has few branches,
    // since a processor could not predict them.
    bool clip(Point3 from, Vector3 to, double& begin, double& end) const {
        std::array<double, kLanes> low, high;
        low.fill(-kMaxMm);
        high.fill(kMaxMm);
        for (std::size_t first = 0; first < kPlanes; first += kLanes) {
            for (std::size_t lane = 0; lane < kLanes; ++lane) {
                // (from + t to - place) . normal < 0
                const std::size_t m = first + lane;
                const double past =
                    (from.x - x[m]) * nx[m] + (from.y - y[m]) * ny[m] + (from.z - z[m]) * nz[m];
                const double slope = to.x * nx[m] + to.y * ny[m] + to.z * nz[m];
                const bool rises = slope > 1e-9, falls = slope < -1e-9;
                const double across = -past / (rises || falls ? slope : 1);
                // A line along a plane, on its other side, lies nowhere.
                const double nowhere = past > 0 ? -kMaxMm : kMaxMm;
                const double above = rises   ? across
                                     : falls ? kMaxMm
                                             : nowhere,
                             below = falls ? across : -kMaxMm;
                high[lane] = above < high[lane] ? above : high[lane];
                low[lane] = below > low[lane] ? below : low[lane];
            }
            if (first % (2 * kLanes) != kLanes) continue;
            begin = std::max(std::max(low[0], low[1]), std::max(low[2], low[3]));
            end = std::min(std::min(high[0], high[1]), std::min(high[2], high[3]));
            if (!(begin < end)) return false;
        }
        begin = std::max(std::max(low[0], low[1]), std::max(low[2], low[3]));
        end = std::min(std::min(high[0], high[1]), std::min(high[2], high[3]));
        return begin < end;
    }
};

}  // namespace

int find_lobule_walls(Int3 cell,
                      double cell_mm,
                      Point3 corner,
                      const LobuleView& view,
                      std::span<LobuleWall, kMaxLobuleWalls> out) {
    // A wall's middle is no further from the cell's own than this.
    const double reach_mm = view.reach_mm + kShiftMm;
    if (std::abs(view.off_mm) > reach_mm + 1.5 * cell_mm) return 0;
    const Vector3 skin = view.skin;
    const Seeds seeds(cell, cell_mm, corner);
    const Seed own = seeds.at(kOwn);
    const Point3 centre = corner + cell_mm * Vector3{cell.x + 0.5, cell.y + 0.5, cell.z + 0.5};
    Planes planes(seeds, own, view, centre, reach_mm);
    int found = 0;
    for (std::size_t place = kOwn + 1; place < kOther.size(); ++place) {
        const std::size_t m = kOther[place];
        if (!planes.meets[m]) continue;  // most are turned away or off the picture's plane
        const Vector3 normal{planes.nx[m], planes.ny[m], planes.nz[m]};
        Point3 middle{planes.x[m], planes.y[m], planes.z[m]};
        // The wall's middle, first along the skin, then at right angles to that.
        Vector3 along = cross(normal, skin);
        if (dot(along, along) < 1e-6 * dot(normal, normal))
            along = cross(normal, std::abs(normal.x) < std::abs(normal.y) ? Vector3{1, 0, 0}
                                                                          : Vector3{0, 1, 0});
        along = normalized(along);
        const Vector3 across = normalized(cross(normal, along));
        planes.set_normal(m, {});  // this plane holds the line, so it must not bound it
        double begin = 0, end = 0, length = 0;
        bool shows = planes.clip(middle, along, begin, end);
        if (shows) {
            middle = middle + 0.5 * (begin + end) * along;
            length = end - begin;
            shows = planes.clip(middle, across, begin, end);
        }
        planes.set_normal(m, normal);
        if (!shows) continue;
        middle = middle + 0.5 * (begin + end) * across;
        length = std::sqrt(length * (end - begin));
        if (length < kMinMm) continue;
        out[found++] = {middle, normal, length, hash32(own.draw ^ planes.draw[m])};
    }
    return found;
}

}  // namespace sonocase::runtime::physical
