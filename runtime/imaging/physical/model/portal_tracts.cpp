// SPDX-License-Identifier: Apache-2.0

// Portal tracts of effect streaks; streak_plates.h describes them.
#include "runtime/imaging/physical/model/cell_hash.h"
#include "runtime/imaging/physical/model/streak_search.h"

namespace sonocase::runtime::physical {
namespace {

constexpr int kPieces = 8;
constexpr double kTractMm = 22, kAsideMm = 1.5;   // pieces lie along so much, and beside it
constexpr double kBend = 0.25;                    // of a piece against its branch
constexpr double kPieceMm = 6;                    // mean length
constexpr double kThinMm = 0.5, kThickMm = 1.5;   // radius, and what the widest has more
constexpr double kSlab = 2.2, kSlabShare = 0.59;  // deviations of the slab: at all; to half
// Equally likely: a piece's echo over its branch's; a wall's over its piece's, and its length.
constexpr std::array<double, 4> kPieceLevels{0.6, 0.85, 1.15, 1.5};
constexpr std::array<double, 4> kWallLevels{0.4, 0.7, 0.9, 1.1},
    kWallLengths{0.55, 0.75, 0.95, 1.15};

// Numbers drawn one after the other from a cell's hash.
struct Draws {
    std::uint32_t h;
    std::uint32_t bits() { return h = hash32(h + kHashX); }
    double part() { return (bits() >> 8) / 16777216.0; }          // [0, 1)
    double bell() { return 2 * (part() + part() + part()) - 3; }  // deviation 1
};

}  // namespace

void StreakSearch::add_tracts(Point3 corner, std::uint32_t cell) {
    Draws draw{hash32(cell ^ kHashY)};
    if (!(draw.part() < kind.tract_share)) return;
    const auto random_vector = [&] {
        const double x = draw.bell(), y = draw.bell(), z = draw.bell();
        return Vector3{x, y, z};
    };
    const Vector3 any = random_vector();
    const double size = norm(any);
    if (!(size > 1e-3)) return;
    const Vector3 along = any / size;
    const double x = draw.part(), y = draw.part(), z = draw.part();
    const Point3 middle = corner + kind.cell_mm * Vector3{x, y, z};
    const double width = draw.part(), level = kind.levels[draw.bits() >> 29];
    for (int n = 0; n < kPieces; ++n) {
        const Vector3 axis = normalized(along + kBend * random_vector());
        const double at = kTractMm * (draw.part() - 0.5);
        const Point3 centre = middle + at * along + kAsideMm * random_vector();
        const double radius = kThinMm + kThickMm * width * draw.part();
        const double length = kPieceMm * (0.4 + 1.2 * draw.part());
        const std::uint32_t own = draw.bits();
        add_tract_piece(centre, axis, length, radius, level * kPieceLevels[own >> 30], own);
    }
}

void StreakSearch::add_tract_piece(Point3 centre,
                                   Vector3 axis,
                                   double length,
                                   double radius,
                                   double amplitude,
                                   std::uint32_t draw) {
    Point3 p = seen_at_rest(centre);
    const Vector3 a = probe_from_volume.rotation * axis;
    // What the slab cuts out of the piece.
    const double across = std::abs(a.y), slab = kSlab * thickest_mm;
    double from = -0.5 * length, to = 0.5 * length;
    if (across * length > 1e-6) {
        const double crosses = -p.y / a.y;
        from = std::max(from, crosses - slab / across);
        to = std::min(to, crosses + slab / across);
    }
    if (!(from < to)) return;
    p = p + 0.5 * (from + to) * a;
    const double off = p.y / (2.9 * thickest_mm);
    if (bump(off * off) < 0.1) return;
    // A slab fades towards its faces: of a piece that passes through it half the length shows.
    const double passes = std::min(across * (to - from) / (2 * slab), 1.0);
    const double in_slab = (to - from) * (1 - (1 - kSlabShare) * passes);
    const double own_mm = std::sqrt(in_slab * in_slab * (1 - across * across) +
                                    0.25 * radius * radius + 0.36);  // a round wall is no point
    if (frame.press != nullptr) p = pressed(p);
    double r = 0;
    const PlanePoint beam = beam_at({p.x, p.z}, r);
    const double along = a.x * beam.x + a.z * beam.z;
    const double facing = bump(along * along / (kind.face_sin * kind.face_sin));
    if (facing < 0.1 || plates_at(centre) < 0) return;
    // The normal of the wall that faces the beam: across the axis.
    const Vector3 n = normalized(Vector3{beam.x, 0, beam.z} - along * a);
    const double in_plane = std::sqrt(n.x * n.x + n.z * n.z);
    for (const int wall : {0, 1}) {
        const double side = wall == 0 ? -radius : radius;
        Shown shown;
        if (!show({p.x + side * n.x, p.z + side * n.z}, shown)) continue;
        const double off_here = p.y / (2.9 * row_at(shown.depth).elevation_mm);
        const double level = facing * bump(off_here * off_here);
        if (level < 0.1 || found >= static_cast<int>(out.size())) continue;
        Streak& s = out[static_cast<std::size_t>(found)];
        s = {};
        s.tract = true;
        s.centre = shown.at;
        s.normal = {n.x / in_plane, n.z / in_plane};
        s.length_mm = own_mm * kWallLengths[draw >> (8 * wall) & 3];
        s.width_mm = tables.streak_mm;
        s.amplitude = kind.amplitude * tables.streak_scale * amplitude * level *
                      kWallLevels[draw >> (8 * wall + 2) & 3];
        keep(shown, 0, s);
    }
}

}  // namespace sonocase::runtime::physical
