// SPDX-License-Identifier: Apache-2.0

#include "runtime/imaging/physical/model/streak_plates.h"

#include <algorithm>
#include <cmath>

#include "runtime/imaging/noise/noise.h"
#include "runtime/imaging/physical/model/lobule_walls.h"

namespace sonocase::runtime::physical {
namespace {

// Sixteen equally likely values of a gamma distribution of mean 4 and shape 2.5.
constexpr std::array<double, 16> kLengthsMm{0.74, 1.25, 1.63, 1.97, 2.3,  2.63, 2.96, 3.3,
                                            3.67, 4.06, 4.51, 5.01, 5.62, 6.4,  7.53, 9.82};
constexpr std::uint32_t kHashPlace = 0x85EBCA77u;

// Of a plate of muscle: its length across the fibres over that along them (a).
constexpr double kAcrossFibres = 0.35;

// (1 - x)^4, close to a Gaussian, 0 from x = 1 on.
double bump(double x) {
    const double y = std::max(1 - x, 0.0);
    return y * y * y * y;
}

// Where the skin's surface lies: the direction in which the depth below it grows most.
Vector3 layer_normal(const PhysicalScene& scene, Point3 x) {
    constexpr double kReachMm = 4;
    if (scene.layers.empty()) return {};
    const auto depth = [&](double i, double j, double k) {
        return scene.layers.at(scene.grid.voxel_from_point(x + kReachMm * Vector3{i, j, k})).depth;
    };
    // Corners of a tetrahedron.
    const double a = depth(1, 1, 1), b = depth(1, -1, -1), c = depth(-1, 1, -1),
                 d = depth(-1, -1, 1);
    const Vector3 n{a + b - c - d, a - b + c - d, a - b - c + d};
    const double size = norm(n);  // 0: not known
    return size > 1e-6 ? n / size : Vector3{};
}

// A plate in the tissue, frame of the volume.
struct Plate {
    Point3 centre;
    Vector3 normal;          // not unit
    double length_mm = 4;    // along the fibres, if it has any
    std::uint32_t draw = 0;  // random bits
    Vector3 fibres;          // unit; zero: as long in every direction
};

struct Search {
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
    double thickest_mm = 0;  // of the slab: deviation at the face or at the far end
    double pressed_mm = 0;   // tissue shows so much nearer to the face than it lies at rest
    double turned = 0;       // by pressing: sine of the most that the beam at a place turns
    int found = 0;

    // The label that holds plates there; negative: none.
    int plates_at(Point3 x) const {
        const Point3 v = scene.grid.voxel_from_point(x);
        const int label = label_at(scene, static_cast<int>(std::floor(v.x + 0.5)),
                                   static_cast<int>(std::floor(v.y + 0.5)),
                                   static_cast<int>(std::floor(v.z + 0.5)));
        const int cube = scene.fine.frames[static_cast<std::size_t>(label)].cube;
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

    // A normal of a septum: about the skin's in fat, across the fibres in muscle.
    Vector3 lined_up(Vector3 any, Vector3 guide, bool fibres) const {
        if (fibres) return any - dot(any, guide) * guide;
        return guide + (kind.scatter / 64) * any;
    }

    // Sine of the angle to the beam at which a plate shows nothing.
    double widest_sin(bool fibrous) const { return fibrous ? kind.diffuse_sin : kind.face_sin; }
    // Share of its echo that a plate sends back, by the square of that sine.
    double facing(double sine2, bool fibrous) const {
        const double mirror = bump(sine2 / (kind.face_sin * kind.face_sin));
        if (!fibrous) return mirror;
        const double all_ways = 1 - sine2 / (kind.diffuse_sin * kind.diffuse_sin);
        return mirror + kind.diffuse * (1 - mirror) * std::max(all_ways, 0.0);
    }

    void add_cell(int i, int j, int k);
    void add_lobule(Int3 cell, const LobuleView& view);
    void add_plate(const Plate& plate);
};

// normal: not unit, at most 127 long, in steps of 1, frame of the volume.
void Search::add_cell(int i, int j, int k) {
    const Point3 corner =
        scene.grid.origin_mm + kind.cell_mm * Vector3{double(i), double(j), double(k)};
    const Point3 middle = corner + 0.5 * kind.cell_mm * Vector3{1, 1, 1};
    const PlateCells& cells = scene.plate_cells;
    if (!septa && !cells.holds[static_cast<std::size_t>((k * cells.size.y + j) * cells.size.x + i)])
        return;
    const Point3 p = seen_at_rest(middle);
    double r = 0;
    const PlanePoint beam = beam_at({p.x, p.z}, r);
    if (r < kind.first_mm - kind.cell_mm || r > g.depth_mm + kind.cell_mm + pressed_mm) return;
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
    const double widest = std::min(widest_sin(fibres) + turn, 1.0);
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
        add_lobule({i, j, k}, {guide, along, widest, across, p.y, 2.5 * thickest_mm + 0.5});
    }
    const std::uint32_t cell = hash_of_cell(i, j, k);
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
        const std::uint32_t place = hash32(h ^ (cell + t) * kHashPlace);
        const auto part = [&](int shift) { return (place >> shift & 0x3FF) / 1024.0; };
        const std::uint32_t draw = h >> 24 | (place >> 30) << 8;
        add_plate({corner + kind.cell_mm * Vector3{part(0), part(10), part(20)}, normal,
                   kind.length_scale * kLengthsMm[draw & 15], draw, fibres ? guide : Vector3{}});
    }
}

void Search::add_lobule(Int3 cell, const LobuleView& view) {
    std::array<LobuleWall, kMostLobuleWalls> walls;
    const int count = find_lobule_walls(cell, kind.cell_mm, scene.grid.origin_mm, view, walls);
    for (int n = 0; n < count; ++n) {
        const LobuleWall& w = walls[static_cast<std::size_t>(n)];
        add_plate({w.middle, w.normal, w.length_mm, w.draw & 0x3FF, {}});
    }
}

// The part of its length along the fibres that a plate has in the picture: normal in the probe's
// frame, fibres as well, both unit.
double length_in_plane(Vector3 normal, Vector3 fibres) {
    const double square = normal.x * normal.x + normal.z * normal.z;
    const double run = fibres.x * normal.z - fibres.z * normal.x;
    const double along = std::min(run * run / std::max(square, 1e-9), 1.0);
    return kAcrossFibres / std::sqrt(kAcrossFibres * kAcrossFibres * along + 1 - along);
}

void Search::add_plate(const Plate& plate) {
    const auto [centre, normal, longest_mm, draw, fibres] = plate;
    const bool fibrous = dot(fibres, fibres) > 0;
    const double own = 0.25 * longest_mm;
    Point3 p = seen_at_rest(centre);
    if (frame.press != nullptr) {
        // Pressing moves nothing across the plane, and costs most for plates that are too far.
        const double off = p.y / (2.9 * std::sqrt(thickest_mm * thickest_mm + own * own));
        const double in_slab = bump(off * off);
        if (in_slab < 0.1) return;
        double r_at_rest = 0;
        const PlanePoint at_rest = beam_at({p.x, p.z}, r_at_rest);
        const Vector3 n = probe_from_volume.rotation * normal;
        const double along = n.x * at_rest.x + n.z * at_rest.z;
        const double away =
            std::max(std::sqrt(std::max(1 - along * along / dot(n, n), 0.0)) - turned, 0.0);
        if (in_slab * facing(away * away, fibrous) < 0.1) return;
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
    if (level_in(thickest_mm) < 0.1) return;
    double line = 0, sample = 0;
    g.locate({p.x, p.z}, line, sample);
    const int nearest = static_cast<int>(std::clamp(line + 0.5, 0.0, g.scanlines - 1.0));
    const double gap = static_cast<double>(gaps[static_cast<std::size_t>(nearest)]);
    if (gap < 0) return;
    // The gap to the skin closes: the plate shows that much closer to the face.
    const auto row_at = [&](double depth) -> const Row& {
        const int k = static_cast<int>(std::clamp(depth / g.step_mm, 0.0, g.samples - 1.0));
        return tables.rows[static_cast<std::size_t>(k)];
    };
    double shown = r;
    for (int step = 0; step < 3; ++step) shown = r - gap * row_at(shown).contact;
    if (shown < kind.first_mm || shown > g.depth_mm) return;
    const Row& row = row_at(shown);
    const double level = level_in(row.elevation_mm);
    if (level < 0.1 || found >= static_cast<int>(out.size()) || plates_at(centre) < 0) return;
    const double length =
        longest_mm * (fibrous ? length_in_plane(n, probe_from_volume.rotation * fibres) : 1.0);
    Streak& s = out[static_cast<std::size_t>(found)];
    s.centre = {p.x + (shown - r) * beam.x, p.z + (shown - r) * beam.z};
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
    // Beyond 0.9 L from its middle a plate is 0.5 % of itself, beyond three widths 1 %.
    const double reach = 0.9 * length + 3 * s.width_mm;
    const double slope = std::sqrt(std::max(1 - cosine * cosine * in_plane * in_plane, 0.0));
    const double deep = 0.9 * length * slope + 3 * s.width_mm + g.step_mm + 3.3 * std::abs(sunk_mm);
    const double pitch = g.fan ? (g.radius_mm + shown) * g.line_step : g.line_step;
    s.line_begin = std::max(static_cast<int>(line - reach / pitch), 0);
    s.line_end = std::min(static_cast<int>(line + reach / pitch) + 2, g.scanlines);
    s.sample_begin = std::max(static_cast<int>((shown - deep) / g.step_mm), 0);
    s.sample_end = std::min(static_cast<int>((shown + deep) / g.step_mm) + 1, g.samples);
    if (s.line_begin < s.line_end && s.sample_begin < s.sample_end) ++found;
}

}  // namespace

const PlateKind& plate_kind(double frequency_mhz) {
    static constexpr PlateKind kOrgans{
        8, 44, 0.5, 12, 6, {0.41, 0.61, 0.75, 0.9, 1.1, 1.33, 1.64, 2.45}, 1, 0.01, 0};
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
    Search search{kind,
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
    const Vector3 box =
        scene.voxel_mm *
        Vector3{double(scene.grid.size.x), double(scene.grid.size.y), double(scene.grid.size.z)};
    const auto cell = [&](double mm, int axis) {
        return static_cast<int>(std::floor(std::clamp(mm, 0.0, box[axis]) / kind.cell_mm));
    };
    const Vector3 origin = f.volume_from_probe * Point3{0, 0, 0} - scene.grid.origin_mm;
    // Half the slab, half the longest plate, and the cell's own extent along the normal.
    const double thick =
        4 + shift_mm +
        0.5 * kind.cell_mm * (std::abs(normal[u]) + std::abs(normal[v])) / std::abs(normal[a]);
    for (int j = cell(lower[v], v); j <= cell(upper[v], v); ++j) {
        for (int i = cell(lower[u], u); i <= cell(upper[u], u); ++i) {
            const double mu = (i + 0.5) * kind.cell_mm - origin[u],
                         mv = (j + 0.5) * kind.cell_mm - origin[v];
            const double plane = origin[a] - (normal[u] * mu + normal[v] * mv) / normal[a];
            if (plane < -thick || plane > box[a] + thick) continue;
            for (int k = cell(plane - thick, a); k <= cell(plane + thick, a); ++k) {
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
