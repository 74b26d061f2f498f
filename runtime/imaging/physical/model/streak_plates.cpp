// SPDX-License-Identifier: Apache-2.0

#include "runtime/imaging/physical/model/streak_plates.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <span>

#include "runtime/imaging/physical/model/lobule_walls.h"

namespace sonocase::runtime::physical {
namespace {

// Reach of a tract from the cell in which it begins: its half length and what lies beside it.
constexpr double kTractReachMm = 14;

// (1 - x)^4, close to a Gaussian, 0 from x = 1 on.
double bump(double x) {
    const double y = std::max(1 - x, 0.0);
    return y * y * y * y;
}

// Share of its echo below which a plate is left out, and the x at which bump() falls to it, a
// little more.
constexpr double kFaintest = 0.1, kFaintSquare = 0.438;

// A plate in the tissue, frame of the volume.
struct Plate {
    Point3 centre;
    Vector3 normal;          // not unit
    double length_mm = 4;    // along the fibres, if it has any
    std::uint32_t draw = 0;  // random bits
    Vector3 fibres;          // unit; zero: as long in every direction
};

// The search that find_streaks() runs.
struct StreakSearch {
    const PlateKind& kind;
    bool septa;
    const PhysicalScene& scene;
    const ScanGeometry& g;
    const Tables& tables;
    const PhysicalFrame& frame;
    const BreathingField* breathing;
    std::span<const float> gaps;
    std::span<Streak> out;
    Rigid probe_from_volume;
    double thickest_mm = 0;  // deviation of the slab at the face or at the far end
    double pressed_mm = 0;   // tissue shows up to this much nearer to the face than at rest
    double turned = 0;       // sine of the largest angle by which pressing turns a beam at a place
    int found = 0;

    // The label at a place, if it holds plates; negative: it does not. A lesion of the exercise
    // holds none, and a plate that begins beside it does not reach into it.
    int plates_at(Point3 x) const {
        constexpr double kBesideMm = 2;
        const Point3 v = scene.grid.voxel_from_point(x);
        for (const TargetBall& t : scene.targets)
            if (scene.voxel_mm * distance(v, t.centre_vx) < t.reach_mm + kBesideMm) return -1;
        const int label = label_at(scene, static_cast<int>(std::floor(v.x + 0.5)),
                                   static_cast<int>(std::floor(v.y + 0.5)),
                                   static_cast<int>(std::floor(v.z + 0.5)));
        const int cube = scene.fine.frames[label].cube;
        const bool holds =
            septa ? is_muscle_cube(cube) || is_fat_cube(cube) : cube == kParenchymaCube;
        return holds ? label : -1;
    }

    // Where a point of the tissue shows, in the probe's frame, before anything is pressed.
    Point3 seen_at_rest(Point3 x) const {
        if (breathing != nullptr) x = x + breathing->weight(x) * frame.motion.breathing_mm;
        return probe_from_volume * x;
    }
    Point3 pressed(Point3 p) const {
        const PlanePoint q = press::shown_point(*frame.press, {p.x, p.z});
        return {q.x, p.y, q.z};
    }

    // The beam at a place: its direction, and how far the place lies along it.
    PlanePoint beam_at(PlanePoint p, double& r) const {
        if (!g.fan) {
            r = p.z;
            return {0, 1};
        }
        const double x = p.x, z = p.z + g.radius_mm;
        const double from_centre = std::max(std::sqrt(x * x + z * z), 1e-9);
        r = from_centre - g.radius_mm;
        return {x / from_centre, z / from_centre};
    }

    // Normal of a septum: near the skin's normal in fat, across the fibres in muscle.
    Vector3 lined_up(Vector3 any, Vector3 guide, bool fibres) const {
        if (fibres) return any - dot(any, guide) * guide;
        return guide + (kind.scatter / 64) * any;
    }

    // Sine of the angle to the beam from which on a plate does not show.
    double widest_sin(bool fibrous) const { return fibrous ? kind.diffuse_sin : kind.face_sin; }
    // Share of its echo that a plate sends back, by the square of that sine.
    double facing(double sine2, bool fibrous) const {
        const double mirror = bump(sine2 / (kind.face_sin * kind.face_sin));
        if (!fibrous) return mirror;
        const double all_ways = 1 - sine2 / (kind.diffuse_sin * kind.diffuse_sin);
        return mirror + kind.diffuse * (1 - mirror) * std::max(all_ways, 0.0);
    }

    // Sine from which on a plate is too faint to show, with a margin. away: angle, rad, by which
    // the beam may turn between the plate and the place where it is known.
    double faint_sin(bool fibrous, double away) const {
        double sine = std::sqrt(kFaintSquare) * kind.face_sin;
        if (fibrous && kind.diffuse > 0)
            sine = std::max(
                kind.face_sin,
                kind.diffuse_sin * std::sqrt(std::max(1 - 0.99 * kFaintest / kind.diffuse, 0.0)));
        return sine + away + turned;
    }

    // The row of a depth, clamped to the first and the last one.
    const Row& row_at(double depth) const {
        const int k = static_cast<int>(std::clamp(depth / g.step_mm, 0.0, g.samples - 1.0));
        return tables.rows[k];
    }

    void add_cell(int i, int j, int k);
    void add_lobule(Int3 cell, const LobuleView& view);
    void add_plate(const Plate& plate);
    // Adds the tracts that begin in the cell with this lowest corner.
    void add_tracts(Point3 corner, std::uint32_t cell);
    // Adds one straight piece. axis: unit, frame of the volume; draw: random bits of its two walls.
    void add_tract_piece(Point3 centre,
                         Vector3 axis,
                         double length,
                         double radius,
                         double amplitude,
                         std::uint32_t draw);

    // Finds a place of the plane as the picture shows it: the gap to the skin closes, so that the
    // place lies that much closer to the face. False: in air, or out of the picture.
    struct Shown {
        PlanePoint at, beam;
        double depth = 0, line = 0;
    };
    bool show(PlanePoint p, Shown& shown) const {
        double r = 0, sample = 0;
        shown.beam = beam_at(p, r);
        g.locate(p, shown.line, sample);
        const int nearest = static_cast<int>(std::clamp(shown.line + 0.5, 0.0, g.scanlines - 1.0));
        const double gap = static_cast<double>(gaps[nearest]);
        if (gap < 0) return false;
        shown.depth = r;
        for (int step = 0; step < 3; ++step) shown.depth = r - gap * row_at(shown.depth).contact;
        if (shown.depth < kind.first_mm || shown.depth > g.depth_mm) return false;
        shown.at = {p.x + (shown.depth - r) * shown.beam.x, p.z + (shown.depth - r) * shown.beam.z};
        return true;
    }
    // Finds which samples can show a plate whose place, direction, length and width are set, and
    // keeps it if there are any. Beyond 0.9 L from its middle a plate is at 0.5 % of its echo,
    // beyond three widths at 1 %.
    void keep(const Shown& shown, double sunk_mm, Streak& s) {
        const double reach = 0.9 * s.length_mm + 3 * s.width_mm;
        const double facing = s.normal.x * shown.beam.x + s.normal.z * shown.beam.z;
        const double slope = std::sqrt(std::max(1 - facing * facing, 0.0));
        const double deep = 0.9 * s.length_mm * slope + 3 * s.width_mm + g.step_mm + 3.3 * sunk_mm;
        const double pitch = g.fan ? (g.radius_mm + shown.depth) * g.line_step : g.line_step;
        s.line_begin = std::max(static_cast<int>(shown.line - reach / pitch), 0);
        s.line_end = std::min(static_cast<int>(shown.line + reach / pitch) + 2, g.scanlines);
        s.sample_begin = std::max(static_cast<int>((shown.depth - deep) / g.step_mm), 0);
        s.sample_end = std::min(static_cast<int>((shown.depth + deep) / g.step_mm) + 1, g.samples);
        if (s.line_begin < s.line_end && s.sample_begin < s.sample_end) ++found;
    }
};

// Portal tracts.
constexpr int kPieces = 8;
constexpr double kTractMm = 22, kAsideMm = 1.5;  // spread of the pieces along the branch, beside it
constexpr double kBend = 0.25;                   // a piece's deviation from its branch's direction
constexpr double kPieceMm = 6;                   // mean length of a piece
constexpr double kThinMm = 0.5, kThickMm = 1.5;  // smallest radius, and what the largest adds
constexpr double kSlab = 2.2, kSlabShare = 0.59;  // reach of the slab, deviations; share that shows
// Equally likely factors: echo of a piece over its branch's, of a wall over its piece's; wall
// length.
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
    // The part of the piece that lies in the slab.
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
    // The slab fades towards its faces: about half the length of a piece that passes through it
    // shows.
    const double passes = std::min(across * (to - from) / (2 * slab), 1.0);
    const double in_slab = (to - from) * (1 - (1 - kSlabShare) * passes);
    const double own_mm = std::sqrt(in_slab * in_slab * (1 - across * across) +
                                    0.25 * radius * radius + 0.36);  // a round wall is not a point
    if (frame.press != nullptr) p = pressed(p);
    double r = 0;
    const PlanePoint beam = beam_at({p.x, p.z}, r);
    const double along = a.x * beam.x + a.z * beam.z;
    const double facing = bump(along * along / (kind.face_sin * kind.face_sin));
    if (facing < 0.1 || plates_at(centre) < 0) return;
    // The normal of the wall that faces the beam lies across the axis.
    const Vector3 n = normalized(Vector3{beam.x, 0, beam.z} - along * a);
    const double in_plane = std::sqrt(n.x * n.x + n.z * n.z);
    for (const int wall : {0, 1}) {
        const double side = wall == 0 ? -radius : radius;
        Shown shown;
        if (!show({p.x + side * n.x, p.z + side * n.z}, shown)) continue;
        const double off_here = p.y / (2.9 * row_at(shown.depth).elevation_mm);
        const double level = facing * bump(off_here * off_here);
        if (level < 0.1 || found >= static_cast<int>(out.size())) continue;
        Streak& s = out[found];
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

// Sixteen equally likely values of a gamma distribution of mean 4 and shape 2.5.
constexpr std::array<double, 16> kLengthsMm{0.74, 1.25, 1.63, 1.97, 2.3,  2.63, 2.96, 3.3,
                                            3.67, 4.06, 4.51, 5.01, 5.62, 6.4,  7.53, 9.82};

// Length of a plate of muscle across the fibres over that along them (assumed).
constexpr double kAcrossFibres = 0.35;

// Normal of the skin: the direction in which the depth below it grows most; zero: not known.
Vector3 layer_normal(const PhysicalScene& scene, Point3 x) {
    constexpr double kReachMm = 4;
    if (scene.layers.empty()) return {};
    const auto depth = [&](double i, double j, double k) {
        return scene.layers.depth_at(scene.grid.voxel_from_point(x + kReachMm * Vector3{i, j, k}));
    };
    // Corners of a tetrahedron.
    const double a = depth(1, 1, 1), b = depth(1, -1, -1), c = depth(-1, 1, -1),
                 d = depth(-1, -1, 1);
    const Vector3 n{a + b - c - d, a - b + c - d, a - b - c + d};
    const double size = norm(n);  // 0: not known
    return size > 1e-6 ? n / size : Vector3{};
}

// Length of a plate in the picture over its length along the fibres. normal, fibres: unit, in the
// probe's frame.
double length_in_plane(Vector3 normal, Vector3 fibres) {
    const double square = normal.x * normal.x + normal.z * normal.z;
    const double run = fibres.x * normal.z - fibres.z * normal.x;
    const double along = std::min(run * run / std::max(square, 1e-9), 1.0);
    return kAcrossFibres / std::sqrt(kAcrossFibres * kAcrossFibres * along + 1 - along);
}

// Normals are drawn as whole numbers, at most 127 long, in the frame of the volume.
void StreakSearch::add_cell(int i, int j, int k) {
    const Point3 corner =
        scene.grid.origin_mm + kind.cell_mm * Vector3{double(i), double(j), double(k)};
    const Point3 middle = corner + 0.5 * kind.cell_mm * Vector3{1, 1, 1};
    const Point3 p = seen_at_rest(middle);
    double r = 0;
    const PlanePoint beam = beam_at({p.x, p.z}, r);
    const double beyond = kind.cell_mm + (kind.tract_share > 0 ? kTractReachMm : 0);
    if (r < kind.first_mm - beyond || r > g.depth_mm + beyond + pressed_mm) return;
    const int label = septa ? plates_at(middle) : 0;
    if (label < 0) return;
    const Vector3 along = frame.volume_from_probe.rotation * Vector3{beam.x, 0, beam.z};
    const auto bx = static_cast<float>(along.x), by = static_cast<float>(along.y),
               bz = static_cast<float>(along.z);
    // Septa line up with the normal of the skin, or with the direction of the fibres.
    const FineFrame& fine = scene.fine.frames[label];
    const bool fibres = septa && is_muscle_cube(fine.cube);
    // Within a cell beams turn by its size over their distance from the fan's centre.
    const double turn = kind.cell_mm / (g.fan ? std::max(g.radius_mm + r, kind.cell_mm) : 1e9);
    // Breathing moves neighbours by almost the same, so half as much again is enough.
    const double widest = std::min({widest_sin(fibres) + turn, faint_sin(fibres, 1.5 * turn), 1.0});
    const auto min_cos2 = static_cast<float>(1 - widest * widest);
    Vector3 guide;
    if (fibres) {
        guide = normalized(Vector3{static_cast<double>(fine.cube_from_voxel[0]),
                                   static_cast<double>(fine.cube_from_voxel[1]),
                                   static_cast<double>(fine.cube_from_voxel[2])});
    } else if (septa) {
        guide = layer_normal(scene, middle);
    }
    const bool lobules = septa && !fibres;
    if (lobules) {
        const Vector3 across = frame.volume_from_probe.rotation * Vector3{0, 1, 0};
        // The walls of a lobule lie up to four cells away.
        const double facing = std::min(widest_sin(false) + turn, faint_sin(false, 4 * turn));
        add_lobule({i, j, k}, {.skin = guide,
                               .beam = along,
                               .max_sin = std::min(facing, 1.0),
                               .across = across,
                               .off_mm = p.y,
                               .reach_mm = 2.5 * thickest_mm + 0.5});
    }
    const std::uint32_t cell = hash_of_cell(i, j, k);
    if (kind.tract_share > 0) {
        add_tracts(corner, cell);
        constexpr double kPlateReachMm = 6;  // plates of a cell show no further than this
        if (std::abs(p.y) > kPlateReachMm + 0.87 * kind.cell_mm) return;
    }
    const int tries = lobules ? kind.tries_beside_lobules : kind.tries;
    for (std::uint32_t t = 0; t < static_cast<std::uint32_t>(tries); ++t) {
        const std::uint32_t h = hash32(cell + t);
        const auto nx = static_cast<float>(static_cast<std::int8_t>(h)),
                   ny = static_cast<float>(static_cast<std::int8_t>(h >> 8)),
                   nz = static_cast<float>(static_cast<std::int8_t>(h >> 16));
        const float square = nx * nx + ny * ny + nz * nz, cosine = nx * bx + ny * by + nz * bz;
        // Only those within the ball, so that directions are uniform.
        if (!(square < 127.0f * 127.0f)) continue;
        Vector3 normal{static_cast<double>(nx), static_cast<double>(ny), static_cast<double>(nz)};
        if (septa) {
            normal = lined_up(normal, guide, fibres);
            const double facing = dot(normal, along);
            if (!(facing * facing > static_cast<double>(min_cos2) * dot(normal, normal))) continue;
        } else if (!(cosine * cosine > min_cos2 * square)) {
            continue;
        }
        const std::uint32_t place = hash32(h ^ (cell + t) * kHashY);
        const auto part = [&](int shift) { return (place >> shift & 0x3FF) / 1024.0; };
        const std::uint32_t draw = h >> 24 | (place >> 30) << 8;
        add_plate({corner + kind.cell_mm * Vector3{part(0), part(10), part(20)}, normal,
                   kind.length_scale * kLengthsMm[draw & 15], draw, fibres ? guide : Vector3{}});
    }
}

void StreakSearch::add_lobule(Int3 cell, const LobuleView& view) {
    std::array<LobuleWall, kMaxLobuleWalls> walls;
    const int count = find_lobule_walls(cell, kind.cell_mm, scene.grid.origin_mm, view, walls);
    for (int n = 0; n < count; ++n) {
        const LobuleWall& w = walls[n];
        add_plate({w.middle, w.normal, w.length_mm, w.draw & 0x3FF, {}});
    }
}

void StreakSearch::add_plate(const Plate& plate) {
    const auto [centre, normal, longest_mm, draw, fibres] = plate;
    const bool fibrous = dot(fibres, fibres) > 0;
    const double own = 0.25 * longest_mm;
    Point3 p = seen_at_rest(centre);
    const double off_plane = p.y / (2.9 * std::sqrt(thickest_mm * thickest_mm + own * own));
    const double in_slab = bump(off_plane * off_plane);
    if (in_slab < kFaintest) return;
    if (frame.press != nullptr) {
        // Pressing moves nothing across the plane, and its search is costly, so plates that are too
        // faint are left out first.
        double r_at_rest = 0;
        const PlanePoint at_rest = beam_at({p.x, p.z}, r_at_rest);
        const Vector3 n = probe_from_volume.rotation * normal;
        const double along = n.x * at_rest.x + n.z * at_rest.z;
        const double away =
            std::max(std::sqrt(std::max(1 - along * along / dot(n, n), 0.0)) - turned, 0.0);
        if (in_slab * facing(away * away, fibrous) < kFaintest) return;
        p = pressed(p);
    }
    double r = 0;
    PlanePoint beam = beam_at({p.x, p.z}, r);
    const double inverse = 1 / norm(normal);
    const Vector3 n = probe_from_volume.rotation * (inverse * normal);
    const double cosine = n.x * beam.x + n.z * beam.z;
    const double facing_beam = facing(std::max(1 - cosine * cosine, 0.0), fibrous);
    // Most plates are too far from the plane or turned away, which is tested with the thickest slab
    // before their place is found.
    const auto level_in = [&](double slab) {
        const double off = p.y / (2.9 * std::sqrt(slab * slab + own * own));
        return bump(off * off) * facing_beam;
    };
    if (in_slab * facing_beam < kFaintest) return;
    Shown shown;
    if (!show({p.x, p.z}, shown)) return;
    const double level = level_in(row_at(shown.depth).elevation_mm);
    if (level < kFaintest || found >= static_cast<int>(out.size()) || plates_at(centre) < 0) return;
    const double length =
        longest_mm * (fibrous ? length_in_plane(n, probe_from_volume.rotation * fibres) : 1.0);
    Streak& s = out[found];
    s = {};
    s.centre = shown.at;
    const double in_plane = 1 / std::sqrt(n.x * n.x + n.z * n.z);
    s.normal = {n.x * in_plane, n.z * in_plane};
    s.length_mm = length;
    s.width_mm = tables.streak_mm;
    s.amplitude = kind.amplitude * tables.streak_scale * kind.levels[draw >> 4 & 7] * level;
    constexpr std::array<double, 4> kBends{-1, -0.4, 0.4, 1};
    const double sunk_mm = kind.max_bend * kBends[draw >> 8 & 3] * 0.125 * length * length;
    s.bend = sunk_mm / s.width_mm;
    s.ripple = kind.ripple;
    s.per_ripple = 0.5 * length / kind.ripple_mm;
    s.phase = (draw & 15) / 16.0 + (draw >> 4 & 7) / 128.0;
    keep(shown, std::abs(sunk_mm), s);
}

}  // namespace

const PlateKind& plate_kind(double frequency_mhz) {
    static constexpr PlateKind kOrgans{.cell_mm = 8,
                                       .tries = 16,
                                       .face_sin = 0.5,
                                       .first_mm = 12,
                                       .amplitude = 6,
                                       .levels = {0.41, 0.61, 0.75, 0.9, 1.1, 1.33, 1.64, 2.45},
                                       .length_scale = 1,
                                       .max_bend = 0.01,
                                       .scatter = 0,
                                       .ripple = 0,
                                       .ripple_mm = 2,
                                       .diffuse = 0,
                                       .diffuse_sin = 0,
                                       .tries_beside_lobules = 0,
                                       .tract_share = 0.18};
    static constexpr PlateKind kSepta{.cell_mm = 4,
                                      .tries = 18,
                                      .face_sin = 0.45,
                                      .first_mm = 1.5,
                                      .amplitude = 2.6,
                                      .levels = {0.2, 0.41, 0.59, 0.83, 1.19, 1.67, 2.45, 5},
                                      .length_scale = 1.3,
                                      .max_bend = 0.04,
                                      .scatter = 0.3,
                                      .ripple = 1.6,
                                      .ripple_mm = 2.0,
                                      .diffuse = 0.25,
                                      .diffuse_sin = 0.85,
                                      .tries_beside_lobules = 6};
    return frequency_mhz > kSeptaFrequencyMhz ? kSepta : kOrgans;
}

double streak_ripple(const Streak& plate, double along) {
    const auto wave = [](double turns) { return std::abs(turns - std::nearbyint(turns)); };
    const double turns = along * plate.per_ripple + plate.phase;
    return 2 * plate.ripple * (wave(turns) + wave(kSecondRipple * turns) - 0.5);
}

PlateCells find_plate_cells(const PhysicalScene& scene) {
    PlateCells cells;
    const double edge_mm = plate_kind(0).cell_mm;
    const auto count = [&](int voxels) {
        return static_cast<int>(voxels * scene.voxel_mm / edge_mm) + 1;
    };
    cells.size = {count(scene.grid.size.x), count(scene.grid.size.y), count(scene.grid.size.z)};
    for (int k = 0; k < cells.size.z; ++k) {
        for (int j = 0; j < cells.size.y; ++j) {
            for (int i = 0; i < cells.size.x; ++i) {
                const Point3 corner =
                    scene.grid.origin_mm + edge_mm * Vector3{double(i), double(j), double(k)};
                const Point3 v =
                    scene.grid.voxel_from_point(corner + 0.5 * edge_mm * Vector3{1, 1, 1});
                const int label = label_at(scene, static_cast<int>(std::floor(v.x + 0.5)),
                                           static_cast<int>(std::floor(v.y + 0.5)),
                                           static_cast<int>(std::floor(v.z + 0.5)));
                cells.holds.push_back(scene.fine.frames[label].cube == kParenchymaCube);
            }
        }
    }
    return cells;
}

int find_streaks(const PhysicalScene& scene,
                 const ScanGeometry& g,
                 const Tables& tables,
                 const PhysicalFrame& f,
                 const BreathingField* breathing,
                 std::span<const float> gaps,
                 std::span<Streak> out) {
    const bool septa = tables.frequency_mhz > kSeptaFrequencyMhz;
    if (septa ? !scene.has_septa : scene.plate_cells.holds.empty()) return 0;
    const PlateKind& kind = plate_kind(tables.frequency_mhz);
    StreakSearch search{
        .kind = kind,
        .septa = septa,
        .scene = scene,
        .g = g,
        .tables = tables,
        .frame = f,
        .breathing = breathing,
        .gaps = gaps,
        .out = out,
        .probe_from_volume = inverse(f.volume_from_probe),
        .thickest_mm = std::max(tables.rows.front().elevation_mm, tables.rows.back().elevation_mm)};
    if (f.press != nullptr) {
        search.pressed_mm = f.press->farthest_mm();
        const double aside_mm = search.pressed_mm - f.press->state().deepest_mm;
        if (g.fan) search.turned = std::min(aside_mm / std::max(g.radius_mm, 10.0), 1.0);
    }
    const double shift_mm = norm(f.motion.breathing_mm);
    // Columns of cells run along the axis that is nearest to the plane's normal.
    const Vector3 normal = f.volume_from_probe.rotation * Vector3{0, 1, 0};
    int a = 0;
    for (int axis = 1; axis < 3; ++axis) {
        if (std::abs(normal[axis]) > std::abs(normal[a])) a = axis;
    }
    const int u = (a + 1) % 3, v = (a + 2) % 3;
    // The box of the scanned area.
    const auto& first = g.beams.front();
    const auto& last = g.beams.back();
    Vector3 lower{1e9, 1e9, 1e9}, upper{-1e9, -1e9, -1e9};
    for (const PlanePoint p :
         {first.origin, last.origin,
          PlanePoint{first.origin.x + g.depth_mm * first.direction.x, first.origin.z},
          PlanePoint{last.origin.x + g.depth_mm * last.direction.x, g.depth_mm},
          PlanePoint{first.origin.x + g.depth_mm * first.direction.x, g.depth_mm},
          PlanePoint{last.origin.x + g.depth_mm * last.direction.x, last.origin.z}}) {
        const Vector3 at = f.volume_from_probe * Point3{p.x, 0, p.z} - scene.grid.origin_mm;
        for (int axis = 0; axis < 3; ++axis) {
            lower[axis] = std::min(lower[axis], at[axis]);
            upper[axis] = std::max(upper[axis], at[axis]);
        }
    }
    const double beyond = kind.tract_share > 0 ? kTractReachMm : 0;
    lower = lower - beyond * Vector3{1, 1, 1};
    upper = upper + beyond * Vector3{1, 1, 1};
    const Vector3 box =
        scene.voxel_mm *
        Vector3{double(scene.grid.size.x), double(scene.grid.size.y), double(scene.grid.size.z)};
    const auto cell = [&](double mm, int axis) {
        return static_cast<int>(std::floor(std::clamp(mm, 0.0, box[axis]) / kind.cell_mm));
    };
    const Vector3 origin = f.volume_from_probe * Point3{0, 0, 0} - scene.grid.origin_mm;
    // Half the slab, half the longest plate or the reach of a tract beyond its cell, and the cell's
    // own extent along the normal.
    const double thick =
        std::max(4.0, beyond) + shift_mm +
        0.5 * kind.cell_mm * (std::abs(normal[u]) + std::abs(normal[v])) / std::abs(normal[a]);
    const PlateCells& cells = scene.plate_cells;
    const int strides[3] = {1, cells.size.x, cells.size.x * cells.size.y};
    const int last_v = cell(upper[v], v), first_u = cell(lower[u], u), last_u = cell(upper[u], u);
    for (int j = cell(lower[v], v); j <= last_v; ++j) {
        for (int i = first_u; i <= last_u; ++i) {
            const double mu = (i + 0.5) * kind.cell_mm - origin[u],
                         mv = (j + 0.5) * kind.cell_mm - origin[v];
            const double plane = origin[a] - (normal[u] * mu + normal[v] * mv) / normal[a];
            if (plane < -thick || plane > box[a] + thick) continue;
            const int end = cell(plane + thick, a), column = i * strides[u] + j * strides[v];
            for (int k = cell(plane - thick, a); k <= end; ++k) {
                if (!septa && !cells.holds[column + k * strides[a]]) continue;
                int at[3];
                at[u] = i;
                at[v] = j;
                at[a] = k;
                search.add_cell(at[0], at[1], at[2]);
            }
        }
    }
    return search.found;
}

}  // namespace sonocase::runtime::physical
