// SPDX-License-Identifier: Apache-2.0

#include "runtime/imaging/physical/model/streak_plates.h"

#include <algorithm>
#include <cmath>

#include "runtime/imaging/physical/model/lobule_walls.h"
#include "runtime/imaging/physical/model/streak_search.h"

namespace sonocase::runtime::physical {
namespace {

// Sixteen equally likely values of a gamma distribution of mean 4 and shape 2.5.
constexpr std::array<double, 16> kLengthsMm{0.74, 1.25, 1.63, 1.97, 2.3,  2.63, 2.96, 3.3,
                                            3.67, 4.06, 4.51, 5.01, 5.62, 6.4,  7.53, 9.82};

// Of a plate of muscle: its length across the fibres over that along them (a).
constexpr double kAcrossFibres = 0.35;

// Where the skin's surface lies: the direction in which the depth below it grows most.
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

// The part of its length along the fibres that a plate has in the picture: normal in the probe's
// frame, fibres as well, both unit.
double length_in_plane(Vector3 normal, Vector3 fibres) {
    const double square = normal.x * normal.x + normal.z * normal.z;
    const double run = fibres.x * normal.z - fibres.z * normal.x;
    const double along = std::min(run * run / std::max(square, 1e-9), 1.0);
    return kAcrossFibres / std::sqrt(kAcrossFibres * kAcrossFibres * along + 1 - along);
}

}  // namespace

// normal: not unit, at most 127 long, in steps of 1, frame of the volume.
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
    // What septa line up with: the normal of the skin, or the direction of the fibres.
    const FineFrame& fine = scene.fine.frames[static_cast<std::size_t>(label)];
    const bool fibres = septa && is_muscle_cube(fine.cube);
    // Within a cell beams turn by as much as its size over their distance from the fan's centre.
    const double turn = kind.cell_mm / (g.fan ? std::max(g.radius_mm + r, kind.cell_mm) : 1e9);
    // Breathing moves neighbours by almost as much: half as far again.
    const double widest = std::min({widest_sin(fibres) + turn, faint_sin(fibres, 1.5 * turn), 1.0});
    const auto least = static_cast<float>(1 - widest * widest);
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
        // Beyond two deviations of the slab a plate is too faint.
        const Vector3 across = frame.volume_from_probe.rotation * Vector3{0, 1, 0};
        // Its walls lie up to four cells away.
        const double facing = std::min(widest_sin(false) + turn, faint_sin(false, 4 * turn));
        add_lobule({i, j, k},
                   {guide, along, std::min(facing, 1.0), across, p.y, 2.5 * thickest_mm + 0.5});
    }
    const std::uint32_t cell = hash_of_cell(i, j, k);
    if (kind.tract_share > 0) {
        add_tracts(corner, cell);
        constexpr double kPlateReachMm = 6;  // what of a cell's own plates shows
        if (std::abs(p.y) > kPlateReachMm + 0.87 * kind.cell_mm) return;
    }
    const int tries = lobules ? kind.tries_beside_lobules : kind.tries;
    for (std::uint32_t t = 0; t < static_cast<std::uint32_t>(tries); ++t) {
        const std::uint32_t h = hash32(cell + t);
        const auto nx = static_cast<float>(static_cast<std::int8_t>(h)),
                   ny = static_cast<float>(static_cast<std::int8_t>(h >> 8)),
                   nz = static_cast<float>(static_cast<std::int8_t>(h >> 16));
        const float square = nx * nx + ny * ny + nz * nz, cosine = nx * bx + ny * by + nz * bz;
        // Uniform directions: those within the ball.
        if (!(square < 127.0f * 127.0f)) continue;
        Vector3 normal{static_cast<double>(nx), static_cast<double>(ny), static_cast<double>(nz)};
        if (septa) {
            normal = lined_up(normal, guide, fibres);
            const double facing = dot(normal, along);
            if (!(facing * facing > static_cast<double>(least) * dot(normal, normal))) continue;
        } else if (!(cosine * cosine > least * square)) {
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
    std::array<LobuleWall, kMostLobuleWalls> walls;
    const int count = find_lobule_walls(cell, kind.cell_mm, scene.grid.origin_mm, view, walls);
    for (int n = 0; n < count; ++n) {
        const LobuleWall& w = walls[static_cast<std::size_t>(n)];
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
        // Pressing moves nothing across the plane, and costs most for plates that are too far.
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
    // Most plates are too far from the plane or turned away: their most comes before their place.
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
    Streak& s = out[static_cast<std::size_t>(found)];
    s = {};
    s.centre = shown.at;
    const double in_plane = 1 / std::sqrt(n.x * n.x + n.z * n.z);
    s.normal = {n.x * in_plane, n.z * in_plane};
    s.length_mm = length;
    s.width_mm = tables.streak_mm;
    s.amplitude = kind.amplitude * tables.streak_scale * kind.levels[draw >> 4 & 7] * level;
    constexpr std::array<double, 4> kBends{-1, -0.4, 0.4, 1};
    const double sunk_mm = kind.most_bend * kBends[draw >> 8 & 3] * 0.125 * length * length;
    s.bend = sunk_mm / s.width_mm;
    s.ripple = kind.ripple;
    s.per_ripple = 0.5 * length / kind.ripple_mm;
    s.phase = (draw & 15) / 16.0 + (draw >> 4 & 7) / 128.0;
    keep(shown, std::abs(sunk_mm), s);
}

const PlateKind& plate_kind(double frequency_mhz) {
    static constexpr PlateKind kOrgans{
        8, 16, 0.5, 12, 6,   {0.41, 0.61, 0.75, 0.9, 1.1, 1.33, 1.64, 2.45}, 1, 0.01, 0, 0,
        2, 0,  0,   0,  0.18};
    static constexpr PlateKind kSepta{
        4,   18,  0.45, 1.5,  3, {0.2, 0.41, 0.59, 0.83, 1.19, 1.67, 2.45, 5}, 1.3, 0.04, 0.3,
        1.6, 2.0, 0.25, 0.85, 6};
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
                cells.holds.push_back(scene.fine.frames[static_cast<std::size_t>(label)].cube ==
                                      kParenchymaCube);
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
        kind,
        septa,
        scene,
        g,
        tables,
        f,
        breathing,
        gaps,
        out,
        inverse(f.volume_from_probe),
        std::max(tables.rows.front().elevation_mm, tables.rows.back().elevation_mm)};
    if (f.press != nullptr) {
        search.pressed_mm = f.press->farthest_mm();
        const double aside_mm = search.pressed_mm - f.press->state().deepest_mm;
        if (g.fan) search.turned = std::min(aside_mm / std::max(g.radius_mm, 10.0), 1.0);
    }
    const double shift_mm = norm(f.motion.breathing_mm);
    // Columns of cells along the axis that the plane's normal follows most.
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
                if (!septa && !cells.holds[static_cast<std::size_t>(column + k * strides[a])])
                    continue;
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
